"""Pages of a project, from its first trial to a recogniser; they train, so they need the compiler.

`opening.open_studio` serves them. The live page and the server are in runtime/web. `collecting` and `calibrating` need
no library of the compiler.
"""
