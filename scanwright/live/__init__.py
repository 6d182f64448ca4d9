"""The page of `scan --live`: the cloud while it grows."""
