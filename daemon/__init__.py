"""The batch daemon: from campaign files to recorded, judged runs."""
