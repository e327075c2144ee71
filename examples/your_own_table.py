# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own table
#
# The tutorial docs/tutorials/your-own-table.md in Python. The sample table is simulated; replace its name by yours.
# `jupytext --to ipynb your_own_table.py` makes a notebook of this file; `python your_own_table.py` runs it as it is.

# %%
import tempfile
from pathlib import Path

import pandas as pd

from thenar.compiler import compile_build, evaluate, from_dataframe, verify
from thenar.runtime import Build

here = Path(globals().get("__file__", "your_own_table.py")).resolve().parent
table = pd.read_csv(here / "home_glove.csv")
table.iloc[:3, :8]

# %% [markdown]
# ## Import
#
# The meaning of each column is found from its name and values. To correct it, pass a `columns.toml` as second argument.

# %%
grasp_set = from_dataframe(table)
print(len(grasp_set), "frames of", grasp_set.trial_ids.max() + 1, "trials; people:", *table["person"].unique())

# %% [markdown]
# ## Evaluate
#
# The accuracy of trials. Each person in turn is left out of the training rows. `nested` selects the inputs in the
# training rows as well.

# %%
study = evaluate(grasp_set, scheme="subject", protocols=("nested",), tables=("compositions",), trainer="linear")
# I: all pads and flex sensors; II, III: selected pads, other pads; IV: flex sensors; V to VII: pads alone.
for row in study.tables[0].rows:
    print(f"{row.name:24} {row.rate.mean:6.1%}")

# %% [markdown]
# ## Compile
#
# ID3 chooses levels of the pads; the classifier becomes integer tables. `folds=0` measures no accuracy.

# %%
folder = Path(tempfile.mkdtemp()) / "build"
report = compile_build(grasp_set, folder, prune=100, trainer="linear", folds=0)
print(report.tables_bytes, "bytes of tables;", report.firmware)

# %% [markdown]
# ## Verify
#
# Every row goes through the trained model and through the integer tables.

# %%
assert verify(folder, grasp_set).holds

# %% [markdown]
# ## Run
#
# A frame is the bits of the kept levels and the codes of the joints, in the order of the build.

# %%
build = Build.load(folder)
frame = 0
pads = dict(zip(grasp_set.taxel_names, grasp_set.taxels[frame], strict=True))
bits = [pads[level.source] > level.threshold.code for level in build.manifest.switches]
print(build.classify(bits, grasp_set.codes[frame]), "predicted,", table["grasp"][frame], "recorded")
