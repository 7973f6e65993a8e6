"""The page ``build/measured/warning_quality.md``."""

from __future__ import annotations

from pathlib import Path

from bench.tables import Table
from evaluate import closed_loop, score
from evaluate.campaign import (
    ERRONEOUS,
    ERROR_FAMILIES,
    FIXED,
    HOLDING,
    MAIN,
    SLIPPING_FAMILIES,
    Campaign,
    factor_name,
)
from evaluate.closed_loop import Outcome
from evaluate.families import FAMILIES
from evaluate.goals import ALL, EXACT, goals, percent, rejections, whole
from evaluate.methods import METHODS, OPERATED_AT, Found
from evaluate.running import Variant
from evaluate.truth import LEAST_S, PAUSE_S, SPEED_MPS

INTRODUCTION = """\
How good are slipd's warnings where friction is not known? {runs} runs of {grasps} simulated grasps, {seeds} of each of
{families} families. A grasp is simulated with distributed stick and slip between the object and the pads
([physics](physics.md)), without slipd's own mechanics. Object, contact shape, μ_s, μ_d/μ_s (0.6 to 0.97), loads and
noise are drawn at random. The bytes of emulated strain gauges (1 kHz) and of a PVDF pad (200 images/s) of one finger
enter the engine at reads 1 ms apart, and what it publishes is held against what really happened. The config gives μ as
0.8 to 1.2 times the true one, or not at all. Tuning uses other seeds than this page.

Where the object slides, does its contact move over the pad? That of an object smaller than the pad does, or of an edge
or a bar, and the image shows it: so in the families *creep* and *edge*, and in every second grasp of the families that
hold. The contact of a flat object larger than the pad stays: so in *flat creep* and all other families that slip.

Three things are kinder than a real rig. The true λ is solved by slipd's own limit surface, for the simulated
pressure; the onsets of the simulated slips agree with it ([simulator](simulator.md)), but do not depend on it. The
config states the noise of the sensors and the growth of the contact as they are. And the runs of one grasp with several
μ share its noise: where a report does not depend on μ they repeat each other, so bounds on rates and shares, which take
every run as independent, are too narrow there.

`make evaluate` makes this page; `python -m evaluate --quick` prints the figures of a few families in less than a minute
(see its help in `benchmarks/evaluate/__main__.py`). `python -m evaluate.calm` counts false alarms over
[calm hours](calm_hours.md).

![Figures by family and μ, leads of warnings and latencies](warning_quality.png)"""


def page(
    header: str, campaign: Campaign, found: dict[str, Found], seeds_of_methods: int, loop: dict[str, list[Outcome]]
) -> str:
    """Return the page."""
    intro = INTRODUCTION.format(
        runs=len(campaign.results), grasps=len(FAMILIES) * campaign.seeds, families=len(FAMILIES), seeds=campaign.seeds
    )
    asked = goals(campaign)
    judged = [row[3] for row in asked.rows if row[3]]
    intro += f"\n\n**In short**: {judged.count('yes')} of {len(judged)} figures asked for are reached."
    tables = (asked, *families_tables(campaign), by_mu(campaign), rejections(campaign))
    parts = [f"# Quality of the warnings\n\n{header}.", intro, *(table.markdown().strip() for table in tables)]
    parts += [errors(campaign).markdown().strip(), methods(found, seeds_of_methods).markdown().strip()]
    parts += ["![Errors of every method over all thresholds, and the cost of a decision](warning_quality_methods.png)"]
    parts += [closed_loop.table(loop).markdown().strip()]
    parts += ["## One grasp of each family", GRASPS, definitions()]
    return "\n\n".join(parts) + "\n"


GRASPS = """\
μ of the config is the true one; the seed is one for tuning.

![True and reported utilisation, levels and gross slip of one grasp of every family](warning_quality_grasps.png)"""


def families_tables(campaign: Campaign) -> list[Table]:
    """Return the figures of every family, all μ factors together."""
    slips = Table(
        "Families that slip",
        ("family", "slips ≥ 100 ms", "warned", "lead p50 / p5, ms", "latency p50 / p95, ms", "missed", "silent",
         "false before", "reported / stable while sliding", "changes p95"),
        notes=["All five μ factors; *lead* is that of the slips warned of, ∞ a latency that never ended."],
    )  # fmt: skip
    for name in SLIPPING_FAMILIES:
        s = campaign.summary([name], *ALL)
        slips.rows.append((
            name, s.long, percent(s.warned), f"{whole(s.lead_p50_ms)} / {whole(s.lead_p5_ms)}",
            f"{whole(s.latency_p50_ms)} / {whole(s.latency_p95_ms)}", percent(s.missed), percent(s.silent),
            percent(s.early), f"{percent(s.reported)} / {percent(s.stable)}", whole(s.changes_p95),
        ))  # fmt: skip
    holds = Table(
        "Families that hold",
        ("family", "grasps", "false `slipping`", "in h", "upper bound, 1/h", "grasps with one", "false warnings",
         "upper bound, 1/h", "error of λ p50 / p95"),
        notes=["Five μ factors and no μ; the error of λ at the true μ. Bounds are Poisson, one-sided, 95 %."],
    )  # fmt: skip
    for name in HOLDING:
        s = campaign.summary([name], *MAIN)
        exact = campaign.summary([name], EXACT)
        holds.rows.append((
            name, s.runs, s.false_slipping, f"{s.quiet_h:.3f}", f"{s.false_slipping_upper:.1f}", percent(s.early),
            s.false_warnings, f"{s.false_warnings_upper:.1f}", f"{percent(exact.used_p50)} / {percent(exact.used_p95)}",
        ))  # fmt: skip
    return [slips, holds]


def by_mu(campaign: Campaign) -> Table:
    """Return the figures of all families for every μ, and with a μ that is not learned."""
    table = Table(
        "By the μ of the config",
        ("μ factor", "warned", "second slip warned", "lead p5, ms", "missed", "silent", "reported while sliding",
         "stable while sliding", "false warnings, 1/h", "`grip_needed_n` > 5 % short"),
        notes=["All families. *Fixed*: `mu_spread = 0`, the config's μ is taken as exact and none is learned."],
    )  # fmt: skip
    for variant in (*MAIN, *(Variant(factor, finger_lines=FIXED) for factor in (0.8, 1.0, 1.2))):
        families = SLIPPING_FAMILIES if variant.finger_lines else tuple(FAMILIES)
        s, again = campaign.summary(families, variant), campaign.summary(["second slip"], variant)
        fixed = " fixed" if variant.finger_lines else ""
        rate = f"{s.false_warnings / s.safe_h:.1f}" if s.safe_h else "–"
        table.rows.append((
            factor_name(variant) + fixed, percent(s.warned), percent(again.warned_again), whole(s.lead_p5_ms),
            percent(s.missed), percent(s.silent), percent(s.reported), percent(s.stable), rate, percent(s.grip_short),
        ))  # fmt: skip
    return table


def errors(campaign: Campaign) -> Table:
    """Return what errors of the user cost."""
    table = Table(
        "With errors of the user",
        ("error", "warned", "missed", "silent", "false before, or in a hold", "false warnings, 1/h", "error of λ p95"),
        notes=[f"Families {', '.join(ERROR_FAMILIES)}, at the true μ. The config does not know of the error."],
    )
    for variant in (EXACT, *ERRONEOUS):
        s = campaign.summary(ERROR_FAMILIES, variant)
        table.rows.append((
            variant.error or "none", percent(s.warned), percent(s.missed), percent(s.silent), percent(s.early),
            f"{s.false_warnings / s.safe_h:.1f}" if s.safe_h else "–", percent(s.used_p95),
        ))  # fmt: skip
    return table


def methods(found: dict[str, Found], seeds: int) -> Table:
    """Return both errors of every method at the threshold in use."""
    table = Table(
        "Methods",
        ("method", "threshold", "slips found", "safe half-seconds with an alarm"),
        notes=[
            f"Of {len(found[METHODS[0]].slips)} slips and {len(found[METHODS[0]].safe)} safe half-seconds, {seeds} "
            "grasps of each of 14 families; μ is 0.8 to 1.2 times the true one. Found: an alarm from 0.5 s before the "
            "onset to 100 ms after it. Evidence of motion counts as an alarm whatever the threshold.",
            "The ellipsoid and the paper's procedure see images at 50 Hz, the others every message.",
        ],
    )
    for name in METHODS:
        false, hit = (float(values[0]) for values in found[name].curve([OPERATED_AT[name]]))
        table.rows.append((name, f"{OPERATED_AT[name]:.2f}", percent(hit), percent(false)))
    return table


def definitions() -> str:
    """Return the definition of every metric, as the code states it."""
    text = (score.__doc__ or "").split("\n\n", 1)[1]
    values = {
        "`PROMPT_S`": f"{1e3 * score.PROMPT_S:.0f} ms", "`EARLY_S`": f"{1e3 * score.EARLY_S:.0f} ms",
        "`LATE_S`": f"{1e3 * score.LATE_S:.0f} ms", "`SAFE`": f"{score.SAFE}",
        "`SETTLED_S`": f"{1e3 * score.SETTLED_S:.0f} ms", "`LEAST_USED`": f"{score.LEAST_USED}",
        "`ORACLE_BEGIN`": f"{score.ORACLE_BEGIN}", "`ORACLE_USED`": f"{score.ORACLE_USED:.2f}",
        "`ORACLE_S`": f"{1e3 * score.ORACLE_S:.0f} ms", "`LEAST_GRIP_N`": f"{score.LEAST_GRIP_N:g} N",
        "in `evaluate.truth`": "below",
    }  # fmt: skip
    for name, value in values.items():
        text = text.replace(name, value)
    slip = (
        f"**Gross slip**: cells with 95 % of the frictional power slide, at more than {1e3 * SPEED_MPS:g} mm/s, for "
        f"{1e3 * LEAST_S:.0f} ms or longer; pauses under {1e3 * PAUSE_S:.0f} ms do not end it. The speed is "
        "√(v² + (ω ρ)²) with v at the centre of the patch and ρ its radius of gyration. Partial slip is not gross slip."
    )
    return f"## Definitions\n\n{text.strip()}\n\n{slip}"


def write(path: Path, text: str) -> None:
    """Write the page."""
    path.write_text(text.replace("``", "`"), encoding="utf-8")
