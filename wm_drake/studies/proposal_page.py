"""Show a proposal on page and terminal, in one form for all studies."""

from collections.abc import Mapping, Sequence

import xarray as xr

from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, quantity_of, text_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.answer import Part
from wm_drake.studies.proposal import AFTER, BEFORE, MOST_LOSS

LINE = "Line to copy"
"""Words before the command that runs what is proposed."""

LEAST_COST = 0.01
"""Rise of a response, as a share, from which it is named as a cost."""

MOST_COSTS = 3
"""Largest number of costs that are named."""


def proposal_part(
    proposal: xr.Dataset,
    why: str,
    words: Mapping[str, str],
    facts: Sequence[tuple[str, str]] = (),
    *,
    machine: str = "the machine",
) -> Part:
    """Return the part in short of a study: what is proposed, why, its costs, its runs.

    Args:
        proposal: As of `wm_drake.studies.proposal.proposal_of`.
        why: Sentence on the reason.
        words: Words for the responses.
        facts: More pairs of word and text, below.
        machine: What is compared with.
    """
    is_made = bool(proposal.is_confirmed)
    first = [
        ("Proposal", proposal_text(proposal, machine)),
        ("Why", why),
        ("What it costs", costs_text(proposal, words) if is_made else ""),
        (LINE, proposal.line_to_copy.item()),
    ]
    return Part(
        "In short",
        (
            LabelledTable(
                "proposal",
                proposal.drop_dims("changed").drop_vars(["is_confirmed", "line_to_copy"]),
                "Before and after",
                "Responses of the worst load, as it is and with the proposal.",
                words=words,
            ),
            LabelledTable("changes", proposal[["value", "keys"]]),
            LabelledTable("proposed", proposal[["is_confirmed", "line_to_copy"]]),
        ),
        facts=[(word, text) for word, text in (*first, *facts) if text],
    )


def proposal_text(proposal: xr.Dataset, machine: str = "the machine") -> str:
    """Return what is proposed in a sentence."""
    values = zip(proposal.changed.values.tolist(), proposal.value.values.tolist(), strict=True)
    changes = [f"{name} to {value}" for name, value in values]
    if not changes:
        return (
            "No change is proposed: none is clearly better without making another response worse "
            f"by more than its limit, {SHARE.text(MOST_LOSS)} if none is given."
        )
    text = listed(changes)
    if GAP in proposal.response.values:
        text += f"; {_gap_text(proposal.sel(response=GAP), machine)}"
    if proposal.is_confirmed:
        return f"Set {text}."
    return f"No change is proposed: runs do not confirm the best one that was found, {text}."


def _gap_text(gap: xr.Dataset, machine: str) -> str:
    """Return the smallest gap after and before in words.

    Args:
        gap: The part of a proposal that is about the gap.
        machine: What has the gap before.
    """
    load = f" (load {gap.load_after.item()})" if "load_after" in gap else ""
    touches = ", so the tub still touches the housing" if gap[AFTER] <= 0.0 else ""
    return (
        f"the smallest gap becomes {text_of(gap[AFTER])}{load} in place of {text_of(gap[BEFORE])} "
        f"of {machine}, by runs{touches}"
    )


def costs_text(proposal: xr.Dataset, words: Mapping[str, str]) -> str:
    """Return the responses that become worse most, of the worst load each."""
    worse = proposal.isel(response=(proposal.loss > LEAST_COST).values)
    if not worse.sizes["response"]:
        return f"no response becomes worse by more than {SHARE.text(LEAST_COST)}"
    ranked, texts = worse.sortby("loss", ascending=False).isel(response=slice(MOST_COSTS)), []
    for name in ranked.response.values.tolist():
        one = ranked.sel(response=name)
        before = quantity_of(one[BEFORE]).number(one[BEFORE])
        after = f"{text_of(one[AFTER])} ({text_of(one.change)})"
        texts.append(f"{words.get(name, name)} {before} → {after}")
    return listed(texts)


def gaps_text(gaps: xr.DataArray) -> str:
    """Return the smallest gap of each load, before and after if there are both.

    Args:
        gaps: Over `setting` and `load`.
    """
    quantity = quantity_of(gaps)
    texts = [
        f"{load} {' → '.join(map(quantity.number, gaps.sel(load=load).values))}"
        for load in gaps["load"].values.tolist()
    ]
    return f"{'; '.join(texts)} ({quantity.unit_text}, each a run)"
