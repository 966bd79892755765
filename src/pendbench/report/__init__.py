"""What a study writes for people to read: tables, plots and a page."""
