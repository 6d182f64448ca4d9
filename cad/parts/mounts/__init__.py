"""Fixed parts that hold servo, bearings and slip ring."""
