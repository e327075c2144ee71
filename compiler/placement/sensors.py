"""The sensors worth buying: switches, pads and joints in one pool, chosen for each number of them.

A sensor is what is bought and wired: a switch, a pad with any number of levels, or a joint's sensor. Its value is what
it adds to a multinomial logistic regression (`Logistic`) of those that are already chosen: a switch as a bit, a pad or
a joint as a line of its codes. Lines choose pads as well as their levels do, and have one weight a type.

The search floats (P. Pudil, J. Novovicova and J. Kittler, "Floating search methods in feature selection", Pattern
Recognition Letters 15, 1994). On the way up, the sensor that lowers the loss most is added. After that, the one that is
missed least is exchanged for another as long as the loss falls. On the way down, from a few sensors more than asked
for, the one that is missed least is dropped, and what is better than the set found on the way up takes its place.

Candidates are the few of the largest estimated gain. The estimate bounds the Hessian of the loss by half the inputs'
products (D. Böhning, "Multinomial logistic regression algorithm", Annals of the Institute of Statistical Mathematics
44, 1992): one product of matrices gives the gains of all sensors. Then the regression is fitted with each candidate.
All sums are exact, and equal losses go to the lower number, so equal rows give equal sensors on every machine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.recipe import Recipe

from ..elementary import Floats, add_up, cholesky, forward
from ..samples import Columns, Samples, TrainingError
from .constraints import Limits
from .elements import Elements, elements_of
from .logistic import Logistic, lines
from .methods.elimination import sampled

SENSORS = "sensors"
SENSORS_HELP = "The sensors that lower the loss of a logistic regression most, by a floating search"
MOST_ROWS = 2048
RIDGE = 0.3
# Candidates that are fitted; sensors that are exchanged for them; sensors beyond those asked for, where the way down
# begins.
CANDIDATES, EXCHANGED, BEYOND = 4, 2, 2
# Steps of L-BFGS for a candidate, and for what is kept; a step that lowers the loss by less than a share is the last.
TRIAL_STEPS, STEPS, TRIAL_TOLERANCE, TOLERANCE = 8, 30, 1e-4, 1e-6
FIRST_STEPS = 60
# On the way down, a set of which the loss is larger by more than this share is not worth exchanges.
NEARLY = 0.02
# A cheaper sensor is preferred if the loss rises by no more than this share.
NEAR = 0.01
# The usual number of sensors up to which is searched.
USUAL = 16
# An exchange has to lower the loss by this share.
LEAST_GAIN = 1e-4
_CENT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SensorSet:
    """Chosen sensors, as numbers in the pool, in the order in which they were added, and the regression of them."""

    sensors: Columns
    fit: Logistic

    @property
    def loss(self) -> float:
        """The loss of the regression."""
        return self.fit.loss


@dataclass(slots=True, eq=False)
class SensorSearch:
    """The search among the sensors of `samples`, rows in which something is held.

    Parameters
    ----------
    samples : Samples
        The rows, with all inputs. Sensors are numbered: switches, then pads, then joints. Of many rows, a sample is
        used.
    have : sequence of int
        Sensors that are always kept.
    never : sequence of int
        Sensors that are never chosen.
    prices : ndarray, optional
        The price of each sensor, shape (sensors,), where `budget` limits their sum.
    budget : float, optional
        The most that the chosen sensors may cost, those of `have` excepted.
    """

    samples: Samples
    have: Columns = ()
    never: Columns = ()
    prices: Floats | None = None
    budget: float | None = None
    _inputs: Floats = field(init=False)
    _products: Floats = field(init=False)
    _varying: NDArray[np.bool_] = field(init=False)
    _rows: Samples = field(init=False)
    _seen: set[frozenset[int]] = field(init=False, default_factory=set)
    _sets: dict[int, dict[int, SensorSet]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._rows = rows = sampled(self.samples, MOST_ROWS)
        self._inputs = np.concatenate([rows.switches.T, lines(rows.taxels), lines(rows.codes)])
        self._varying = np.ptp(self._inputs, axis=1) > 0 if self._inputs.size else np.zeros(len(self._inputs), bool)
        self._varying[list(self.never)] = False
        design = np.concatenate([self._inputs, np.ones((1, len(rows.labels)))])
        self._products = 0.5 * (design @ design.T)

    def sets(self, most: int) -> dict[int, SensorSet]:
        """Return the chosen sensors for every number from those that are always kept to `most`, as far as there are so
        many that vary and that the budget pays for.
        """
        if most not in self._sets:
            self._sets[most] = self._searched(most)
        return self._sets[most]

    def _searched(self, most: int) -> dict[int, SensorSet]:
        self._seen.clear()
        best, now = dict[int, SensorSet](), self._first()
        best[len(now.sensors)] = now
        while len(now.sensors) < most + BEYOND and (added := self._added(now)):
            now = best[len(added.sensors)] = self._exchanged(self._finished(added))
        for number in sorted(best, reverse=True)[1:]:
            fewer = self._finished(self._dropped(best[number + 1]))
            if fewer.loss < (1.0 + NEARLY) * best[number].loss:
                fewer = self._exchanged(fewer)
            if fewer.loss < (1.0 - LEAST_GAIN) * best[number].loss:
                best[number] = fewer
        return {number: self._thrifty(one) for number, one in best.items() if number <= most}

    def _thrifty(self, now: SensorSet) -> SensorSet:
        """Return the set with a cheaper sensor in place of another wherever that is nearly as good."""
        prices, enough = self.prices, (1.0 + NEAR) * now.loss
        if prices is None:
            return now
        for sensor in sorted(now.sensors[len(self.have) :], key=lambda one: -float(prices[one])):
            rest = self._without(now, now.sensors.index(sensor))
            cheaper = [one for one in self._candidates(rest, sensor) if prices[one] < prices[sensor]]
            tried = [self._finished(self._with(rest, one)) for one in cheaper]
            if near := [one for one in tried if one.loss <= enough]:
                now = min(near, key=lambda one: (self.cost(one.sensors), one.loss))
        return now

    def chosen(self, number: int | None) -> SensorSet:
        """Return the chosen sensors: this many, or fewer if no more vary; None: the best that the budget pays for.

        A number up to USUAL gives the set of the search up to USUAL, so curves and placements agree. Raises
        TrainingError if more are always kept.
        """
        if number is not None and len(self.have) > number:
            raise TrainingError(f"``have`` names {len(self.have)}, ``sensors`` allows {number}: keep more")
        there = int(self._varying.sum())
        if number is not None and self.budget is None and number > max(USUAL, there // 2):
            return self._left(number)
        sets = self.sets(max(there if number is None else number, USUAL))
        if number is None:
            return min(sets.values(), key=_loss)
        return sets[min(max(number, min(sets)), max(sets))]

    def stand_ins(self, now: SensorSet) -> tuple[SensorSet | None, ...]:
        """Return, for each of the sensors, the set with the best other one in its place, as the last; None if none is
        left, or it is always kept.
        """
        missed = self._missed(now)
        return tuple(self._replaced(now, place) if place in missed else None for place in range(len(now.sensors)))

    def _replaced(self, now: SensorSet, place: int) -> SensorSet | None:
        rest = self._without(now, place)
        others = self._candidates(rest, now.sensors[place])
        return min((self._finished(self._with(rest, one)) for one in others), key=_loss, default=None)

    def _left(self, number: int) -> SensorSet:
        """Return this many sensors: what is left of all when those that are missed least are dropped."""
        others = np.setdiff1d(np.flatnonzero(self._varying), self.have).tolist()
        now = self._first(others)
        while len(now.sensors) > max(number, len(self.have)):
            now = self._finished(self._dropped(now))
        return now

    def _first(self, others: Sequence[int] = ()) -> SensorSet:
        rows, have = self._rows, (*self.have, *others)
        fit = Logistic(self._inputs[list(have)], rows.labels, rows.n_classes, RIDGE)
        return self._finished(SensorSet(have, fit), FIRST_STEPS)

    def _added(self, now: SensorSet) -> SensorSet | None:
        """Return the set with the sensor that lowers the loss most; None if no sensor is left."""
        return min((self._with(now, sensor) for sensor in self._candidates(now)), key=_loss, default=None)

    def _dropped(self, now: SensorSet) -> SensorSet:
        """Return the set without the sensor that is missed least."""
        return min((self._without(now, place) for place in self._missed(now)[:CANDIDATES]), key=_loss)

    def _exchanged(self, now: SensorSet) -> SensorSet:
        """Return the set after all exchanges of a sensor that is missed little that lower the loss."""
        while better := next((one for one in self._exchanges(now) if one.loss < (1.0 - LEAST_GAIN) * now.loss), None):
            now = self._finished(better)
        return now

    def _exchanges(self, now: SensorSet) -> Iterator[SensorSet]:
        """Yield the set with the best other sensor in place of each of those that are missed least."""
        for place in self._missed(now)[:EXCHANGED]:
            rest = self._without(now, place)
            others = self._candidates(rest, now.sensors[place])
            new = [one for one in others if frozenset({*rest.sensors, one}) not in self._seen]
            self._seen |= {frozenset({*rest.sensors, one}) for one in new}
            if new:
                yield min((self._with(rest, one) for one in new), key=_loss)

    def _candidates(self, now: SensorSet, *never: int) -> list[int]:
        """Return the sensors of the largest estimated gain, or gain for its price, that may be added."""
        inside = [*now.sensors, -1]
        across = forward(self._factor(now), self._products[inside])
        alone = self._products.diagonal() + RIDGE - add_up(across * across)
        slopes = now.fit.slopes(self._inputs).T
        gains = add_up(slopes * slopes) / alone[:-1]
        free = self._varying.copy()
        free[[*now.sensors, *never]] = False
        if self.prices is not None and self.budget is not None:
            free &= self.prices <= self.budget - self.cost(now.sensors) + _CENT
            gains = gains / np.maximum(self.prices, _CENT)
        order = np.argsort(-gains, kind="stable")
        found: list[int] = order[free[order]][:CANDIDATES].tolist()
        return found

    def cost(self, sensors: Sequence[int]) -> float:
        """Return the price of sensors together, those that are always kept excepted."""
        bought = [one for one in sensors if one not in self.have]
        return 0.0 if self.prices is None else float(self.prices[bought].sum())

    def _missed(self, now: SensorSet) -> list[int]:
        """Return the places of the sensors that may be dropped, the one first whose loss is estimated to cost least."""
        inverse = forward(self._factor(now), np.eye(len(now.sensors) + 1))
        rows = now.fit.rows[:-1].T
        rises = add_up(rows * rows) / add_up(inverse * inverse)[:-1]
        return [place for place in np.argsort(rises, kind="stable").tolist() if place >= len(self.have)]

    def _factor(self, now: SensorSet) -> Floats:
        """Return Cholesky's factor of the bound of the Hessian."""
        inside = [*now.sensors, -1]
        bound = self._products[np.ix_(inside, inside)]
        bound[np.diag_indices(len(now.sensors))] += RIDGE
        return cholesky(bound)

    def _with(self, now: SensorSet, sensor: int) -> SensorSet:
        fit = now.fit.having(self._inputs[sensor])
        fit.improve(TRIAL_STEPS, TRIAL_TOLERANCE)
        return SensorSet((*now.sensors, sensor), fit)

    def _without(self, now: SensorSet, place: int) -> SensorSet:
        fit = now.fit.without([place])
        fit.improve(TRIAL_STEPS, TRIAL_TOLERANCE)
        return SensorSet((*now.sensors[:place], *now.sensors[place + 1 :]), fit)

    @staticmethod
    def _finished(now: SensorSet, steps: int = STEPS) -> SensorSet:
        now.fit.improve(steps, TOLERANCE)
        return now


def sensor_names(samples: Samples, elements: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the sensors of `samples`: of switches and pads, and of joints, as far as they are read."""
    wide = samples.n_switches + samples.taxels.shape[1]
    return (*(elements if wide else ()), *(joints if samples.codes.shape[1] else ()))


def search_of(samples: Samples, limits: Limits | None) -> SensorSearch:
    """Return the search among the sensors of `samples` under limits."""
    if limits is None:
        return SensorSearch(samples)
    names = sensor_names(samples, limits.names, limits.joints)
    have, never = (
        tuple(place for place, name in enumerate(names) if name in some) for some in (limits.keep, limits.never)
    )
    prices = np.array([limits.prices[name] for name in names]) if limits.prices else None
    return SensorSearch(samples, have, never, prices, limits.price)


def select_sensors(samples: Samples, recipe: Recipe, limits: Limits | None) -> tuple[Elements, Columns, Columns]:
    """Return the elements of `samples`, and the columns of those that the chosen sensors are read as, and of joints.

    A pad is kept with all its levels. Raises TrainingError if `have` names more than are to be kept.
    """
    elements = elements_of(samples, recipe.levels)
    return elements, *read_by(samples, elements, search_of(samples, limits).chosen(recipe.sensors).sensors)


def read_by(samples: Samples, elements: Elements, sensors: Columns) -> tuple[Columns, Columns]:
    """Return the columns of the `elements` of samples that sensors are read as, and of joints."""
    wide = samples.n_switches + samples.taxels.shape[1]
    places: dict[int, list[int]] = {}
    for place, element in enumerate(elements):
        places.setdefault(element.column, []).append(place)
    columns = tuple(place for sensor in sensors for place in places.get(sensor, ()))
    return columns, tuple(sorted(sensor - wide for sensor in sensors if sensor >= wide))


def _loss(one: SensorSet) -> float:
    return one.loss
