"""The bench file without its `simulation:` block, so that a recording's attachments never tell the truth.

The block goes into the `padbench.simulation` record, which no fit reads (contracts.md).
"""

from __future__ import annotations

import yaml

BLOCK = "simulation"


def without_truth(text: str) -> tuple[str, str | None]:
    """The bench file's text without the block, and the block's own text (None where there is none).

    The rest stays verbatim. Where cutting the text would change more than the block (flow style, anchors used
    elsewhere), the rest is written anew with the same content. Text that is no YAML mapping comes back unchanged.
    """
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError:
        return text, None
    if not isinstance(root, yaml.MappingNode):
        return text, None
    pairs = [(key, value) for key, value in root.value if key.value == BLOCK]
    if not pairs:
        return text, None
    key, value = pairs[0]
    start, end = key.start_mark.index, _end(text, value)
    wanted = yaml.safe_load(text)
    del wanted[BLOCK]
    rest = text[:start] + text[end:]
    try:
        same = yaml.safe_load(rest) == wanted
    except yaml.YAMLError:
        same = False
    if not same:
        rest = yaml.safe_dump(wanted, sort_keys=False, allow_unicode=True) if wanted else ""
    return rest, text[start:end]


def _end(text: str, value: yaml.Node) -> int:
    """Where the block's text ends: with the line break after its last line, where nothing follows on that line."""
    end: int = value.end_mark.index
    line_end = text.find("\n", end)
    line_end = len(text) if line_end < 0 else line_end + 1
    tail = text[end:line_end].strip()
    return line_end if not tail or tail.startswith("#") else end
