"""The handlers, one file per kind of resource. They only translate between HTTP and the parts in `Api`."""
