"""A page that computes in the browser what bodies that were made here answer."""
