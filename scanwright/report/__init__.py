"""`report.html`: one page with the results of a build, made from its files."""
