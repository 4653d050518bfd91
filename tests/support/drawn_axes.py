"""What axes show, by the words of their legend."""


def labels(ax):
    """The texts of the legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def line(ax, label):
    """The line or the dots that the legend calls `label`."""
    return next(found for found in ax.lines if found.get_label() == label)
