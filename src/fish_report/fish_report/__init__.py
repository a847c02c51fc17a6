"""What people read and type: the command robofish, HTML pages, tables, JSON files, worker pools, user errors."""
