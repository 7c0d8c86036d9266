"""The bench file without its `simulation:` block, so that a recording's attachments never tell the truth.

The block goes into the `padbench.simulation` record, which no fit reads (docs/formats.md).
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
    start = key.start_mark.index
    end = _end(text, start, value)
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


def _end(text: str, start: int, value: yaml.Node) -> int:
    """Where the block's text ends: after its last line, before comments that stand at the margin behind it."""
    end: int = value.end_mark.index
    if "\n" not in text[start:end]:
        line_end = text.find("\n", end)
        alone = line_end >= 0 and not text[end:line_end].strip()
        return line_end + 1 if alone else end
    lines = text[start:end].splitlines(keepends=True)
    while len(lines) > 1 and (not lines[-1].strip() or lines[-1].startswith("#")):
        end -= len(lines.pop())
    return end
