"""From a task to `out/<task>/`: the order of a build, its folder, its manifest, what is current."""
