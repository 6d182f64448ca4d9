"""From one scanner to a fleet: a study crosses tasks and products, and answers with what they trade for each other."""
