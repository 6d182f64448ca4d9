"""The task file: its regions and shapes, the products it names, the tasks that come with the package."""
