"""Registration of clouds from several scan positions to one map."""
