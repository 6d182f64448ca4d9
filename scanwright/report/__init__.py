"""`report.html`: one page that holds everything a person wants to know of a build, made from its files alone."""
