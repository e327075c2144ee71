"""A trainer from another package: naive Bayes on switches and binned joints, whose log odds are a sum over inputs."""

import numpy as np

from thenar.compiler import ScoreTables, Setting, Trainer


class NaiveBayes(Trainer):
    """Every input says, independently of the others, how likely each grasp type is."""

    name = "naive-bayes"
    what = "naive Bayes: inputs are independent within a grasp type"
    settings = (
        Setting("smoothing", "What naive Bayes adds to every count.", float, 1.0, least=0.01),
        Setting("joint_bins", "Into how many bins naive Bayes cuts a joint.", int, 8, least=2),
    )

    def train(self, samples, settings, report=None):
        """Return the logarithms of smoothed shares, as tables of each input."""
        members = samples.labels == np.arange(samples.n_classes)[:, None]  # (K, n)
        rows, extra = members.sum(axis=1), settings["smoothing"]

        def shares(indicators):  # (c, n) of the c things that an input can say -> logarithms (c, K)
            counts = indicators.astype(float) @ members.T
            return np.log((counts + extra) / (rows + extra * len(indicators)))

        bias, switch_rows = np.log((rows + extra) / (rows.sum() + extra * len(rows))), []
        for closed in samples.switches.T:
            of_open, of_closed = shares(np.stack([~closed, closed]))
            bias = bias + of_open
            switch_rows.append(of_closed - of_open)
        thresholds, joint_rows = [], []
        for codes in samples.codes.T:
            quantiles = np.quantile(codes, np.linspace(0, 1, settings["joint_bins"] + 1)[1:-1], method="lower")
            steps = np.unique(quantiles).astype(np.uint16)
            bins = np.searchsorted(steps, codes)  # a code goes into the first bin whose threshold is not below it
            thresholds.append(steps)
            joint_rows.append(shares(bins == np.arange(len(steps) + 1)[:, None]))
        rows_of_switches = np.array(switch_rows).reshape(len(switch_rows), samples.n_classes)
        return ScoreTables.of(bias, rows_of_switches, tuple(thresholds), tuple(joint_rows))


MEMBER = NaiveBayes()
