"""Build folders measured from their files alone; nothing here imports the package."""
