"""How fast logs become signals and estimates, against the usual Python loop."""
