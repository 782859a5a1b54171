"""The handlers, a file for each kind of resource. They translate between HTTP and the parts in `Api`, no more."""
