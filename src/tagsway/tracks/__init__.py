"""From tags in pixels to the motion of tool and product in metres."""

from tagsway.tracks.join import join_tags

__all__ = ["join_tags"]
