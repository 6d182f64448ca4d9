"""The page that shows a scan while it grows, and the gate that every live page stands behind."""
