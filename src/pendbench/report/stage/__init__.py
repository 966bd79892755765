"""The moving picture of one or several runs, as one file that a browser shows without a network."""
