"""Placement as scikit-learn's feature selection: in a Pipeline, in GridSearchCV, on a data frame."""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.drivers.extras import optional

from ..samples import Samples
from .constraints import Limits
from .elements import elements_of
from .methods.base import BEST, METHODS
from .placement import choose
from .ports import PortCosts
from .tree import check_bits

with optional():
    from sklearn.base import BaseEstimator
    from sklearn.feature_selection import SelectorMixin
    from sklearn.utils import Tags
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data

_USUAL = 20


class SwitchSelector(SelectorMixin, BaseEstimator):  # type: ignore[misc]
    """Keep the switches that a placement method chooses.

    Parameters
    ----------
    method : str, default="elimination"
        A name in `thenar.compiler.METHODS`; `thenar place --help` lists them.
    n_switches : int or None, default=None
        The most switches to keep, from 1 to the number of columns; None: 20, or all columns if there are fewer. Fewer
        are kept if fewer vary, or help. Ignored by methods that take the paper's S.
    min_samples : int, default=0
        The paper's S: a node of the tree with fewer rows decides nothing. Ignored by methods that take a number of
        switches.
    ports : PortCosts or None, default=None
        Costs of reading each port, in microseconds, for methods that use them; None: all switches cost the same.
    limits : Limits or None, default=None
        Constraints on the placement; its names are those of the columns of X, all of them switches.
    binarize : float or None, default=None
        A switch counts as closed if its input exceeds this number, as in scikit-learn's `BernoulliNB`. None rejects
        any input that is not a bit, such as a count.

    Attributes
    ----------
    order_ : ndarray of int, shape (n_kept,)
        The kept columns, in the order in which the method chose them; `get_support` and `transform` keep that of X.
    gains_ : ndarray of float, shape (n_kept,)
        The information about the class of each of `order_`, in bits: its gain in the tree for ID3, otherwise alone.
    tree_ : Tree or None
        The tree of the paper's ID3; its classes are numbers of `classes_`, and `tree_.text(names)` prints it.
    parameter_ : int
        The most switches to keep, or the paper's S.
    classes_ : ndarray, shape (n_classes,)
        The labels, in ascending order.
    n_features_in_ : int
        The number of columns of X.
    feature_names_in_ : ndarray of str, shape (n_features_in_,)
        The names of the columns, if X is a data frame.

    Raises
    ------
    ValueError
        In `fit`, if X or y cannot be used; a SettingError for an unknown method, a TrainingError if it cannot choose
        here, or if a number is out of its range.

    References
    ----------
    J. R. Quinlan, "Induction of decision trees", Machine Learning 1 (1986): the method "id3". Of equal gains, exactly
    compared, the lowest column wins.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler import SwitchSelector
    >>> y = np.arange(40) % 4
    >>> X = np.column_stack([y & 1, y >> 1, y == 0, np.ones(40)])
    >>> SwitchSelector(method="cmim", n_switches=2).fit(X, y).get_support()
    array([ True,  True, False, False])
    >>> SwitchSelector("id3", min_samples=13).fit(X, y).tree_.inputs
    (0, 1)
    """

    def __init__(
        self,
        method: str = BEST,
        n_switches: int | None = None,
        min_samples: int = 0,
        ports: PortCosts | None = None,
        binarize: float | None = None,
        limits: Limits | None = None,
    ) -> None:
        self.method = method
        self.n_switches = n_switches
        self.min_samples = min_samples
        self.ports = ports
        self.binarize = binarize
        self.limits = limits

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Choose the switches that distinguish the labels.

        Parameters
        ----------
        X : array-like, shape (n_samples, n_features)
            A column for each switch: bits, or numbers that `binarize` turns into bits.
        y : array-like, shape (n_samples,)
            The grasp type of each row.

        Returns
        -------
        self
        """
        method = METHODS.named(self.method)
        inputs, targets = validate_data(self, X, y)
        check_classification_targets(targets)
        bits = check_bits(inputs) if self.binarize is None else inputs > self.binarize
        self.parameter_ = self._most(bits.shape[1]) if method.by_number else self._least()
        self.classes_, labels = np.unique(targets, return_inverse=True)
        none = np.zeros((len(bits), 0), np.uint16)
        samples = Samples(bits, none, labels, tuple(map(str, self.classes_.tolist())))
        bound = None
        if self.limits is not None:
            if len(self.limits.names) != bits.shape[1]:
                raise ValueError(f"the limits name {len(self.limits.names)} switches, X has {bits.shape[1]} columns")
            bound = self.limits.on(elements_of(samples), self.ports)
        columns, gains, self.tree_ = choose(samples, method.name, float(self.parameter_), self.ports, bound)
        self.order_, self.gains_ = np.array(columns, dtype=np.intp), np.array(gains)
        return self

    def _most(self, columns: int) -> int:
        if self.n_switches is None:
            return min(_USUAL, columns)
        if not isinstance(self.n_switches, int | np.integer) or not 1 <= self.n_switches <= columns:
            raise ValueError(
                f"n_switches={self.n_switches}, and X has n_features = {columns}: give a whole number from 1 to that"
            )
        return int(self.n_switches)

    def _least(self) -> int:
        if not isinstance(self.min_samples, int | np.integer) or self.min_samples < 0:
            raise ValueError(f"min_samples={self.min_samples}: give a whole number of rows, 0 or more")
        return int(self.min_samples)

    def _get_support_mask(self) -> NDArray[np.bool_]:
        check_is_fitted(self)
        mask = np.zeros(self.n_features_in_, np.bool_)
        mask[self.order_] = True
        return mask

    def __sklearn_tags__(self) -> Tags:
        """Tell scikit-learn that labels are needed."""
        tags = super().__sklearn_tags__()
        tags.target_tags.required = True
        return tags
