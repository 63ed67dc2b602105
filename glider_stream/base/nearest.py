"""The nearest of many points: SciPy's tree, loaded when first needed, which takes as long as a small query."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scipy.spatial import KDTree


def tree_of(points: Any) -> "KDTree":
    """Return the tree of points (n, d), which answers which of them are nearest to others."""
    from scipy.spatial import KDTree

    return KDTree(points)
