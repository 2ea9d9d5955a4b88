"""The free decay: its window, its first mode, and how sure both are."""

from tagsway.modal.bound import find_bound
from tagsway.modal.identify import ModalFit, identify_modes
from tagsway.modal.window import find_window

__all__ = ["ModalFit", "find_bound", "find_window", "identify_modes"]
