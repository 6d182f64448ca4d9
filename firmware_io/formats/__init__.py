"""One file per cloud format: what it can hold goes in and comes out, what it cannot is said."""
