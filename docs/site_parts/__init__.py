"""Extensions of Sphinx that the site is built with, one idea a module."""
