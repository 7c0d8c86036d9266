"""Friction at the probe, felt by the load cell: ±F_c against the direction of motion.

Force as a function of speed alone jumps at reversal and has no single value at rest, which no implicit step can solve
and no real bearing shows. All forms therefore slide in over a short presliding distance: the force depends on the path
since the last reversal, rises with it, and is a continuous function of position.

- `coulomb`: Prandtl's element, a spring F_c/presliding in series with a slider of F_c. Between reversals, beyond
  the presliding distance, it is exactly ±F_c at any speed.
- `presliding`: Dahl's model, dF/dy = (F_c/d)(1 − sgn(v) F/F_c): the approach to F_c is gradual (P. R. Dahl, A solid
  friction model, Aerospace Corporation TOR-0158(3107-18)-1, 1968). Integrated exactly over a step.
- `stribeck`: Prandtl's element whose slider holds F_c + (F_s − F_c) e^(−(v/v_s)^2), with viscous · v beside it: to
  break away takes more than to slide, and oil adds with speed (B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A
  survey of models, analysis tools and compensation methods for the control of machines with friction, Automatica 30,
  1994, 1083–1138).

- `load_dependent`: Prandtl's element whose slider holds F_c (1 + load · δ): guides and seals that bear more the deeper
  the probe stands in the pad (F. P. Bowden, D. Tabor, The Friction and Lubrication of Solids, Oxford, 1950).
- `pressed`: Prandtl's element whose slider holds F_c (1 + load · |F|), F the pad's force: a joint that bears what is
  pressed, by Amontons' law (Bowden, Tabor, the same).
- `maxwell_slip`: five of Prandtl's elements side by side, their distances spread geometrically: the build-up is gradual
  and remembers inner loops (W. D. Iwan, J. Appl. Mech. 33, 1966, 893–900).
- `worked_in`: Prandtl's element whose slider holds F_c (1 + stiffness s): grease that has lain is stiffer, gets worked
  in along the way, and comes back at rest: s' = (1 − s)/rest − s |v|/way, whole at first (P. M. Lugt, Grease
  Lubrication in Rolling Bearings, Wiley, 2013). `coulomb` is what is left when it is worked in.
- `uneven`: Prandtl's element whose slider holds another force at each place, as between rails that are not parallel:
  F_c (1 + two terms of a Fourier series over `reach`), so that F_c is the mean over the depths (B. Armstrong-Hélouvry,
  Control of Machines with Friction, Kluwer, 1991: friction depends on the position).
- `tight`: Prandtl's element whose slider holds F_c (1 + more · e^(−((y − place)/width)²)): a rail that is dented or
  dirty at one place (B. Armstrong-Hélouvry, the same). F_c is that far from there.
- `logarithmic`: Prandtl's element whose slider holds F_c (1 + growth ln((v_0 + |v|)/(v_0 + 1 mm/s))), v_0 = 0.1 mm/s:
  polymers creep over what they slide on, and so bear more the quicker they go (B. J. Briscoe, D. Tabor, Friction and
  wear of polymers: the role of mechanical properties, Br. Polym. J. 10, 1978, 74–78). F_c is that at 1 mm/s.
- `swelling`: Prandtl's element whose slider holds F_c (1 + swell · sin(2π y/turn + angle)), as a guide's balls come
  into the track and go, one after another (H. Ohta, Y. Kitajima, S. Kato, Y. Igarashi, Effects of ball groupings on
  ball passage vibrations of a linear guideway type ball bearing, J. Tribol. 129, 2007, 188–193).
- `one_way`: Prandtl's element whose slider holds F_c (1 + differs) on the way in and F_c (1 − differs) on the way out,
  as of a seal whose lip points one way (B. Armstrong-Hélouvry, Control of Machines with Friction, Kluwer, 1991: the
  level depends on the direction). Wherever it slides, this is `coulomb` beside a bias; at the first sample it is none.
- `tared_out`, `tared_in`: Prandtl's element that stood stuck, at −F_c where the probe had come out to where it stands
  or at F_c where it had come in, when the force was set to zero: 0 and 2 F_c from there on, or −2 F_c and 0.
- `smoothed`: F_c tanh(v/v_0), nothing at rest: what vibration makes of dry friction, and a film of oil (V.
  Pervozvanski, C. Canudas de Wit, Asymptotic analysis of the dither effect in systems with friction, Automatica 38,
  2002, 105–113).
- `by_speed`: (F_c + (F_s − F_c) e^(−(v/v_s)²)) tanh(v/v_0) + viscous · v, the Stribeck curve itself: at rest there is
  none (H. Olsson, K. J. Åström, C. Canudas de Wit, M. Gäfvert, P. Lischinsky, Friction models and friction
  compensation, Eur. J. Control 4, 1998, 176–195, static models).

State: last position, force, whether there was a position yet. A first position is rest without friction force.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from sim.effects.base import Effect, Form, Parameter
from sim.effects.sliders import (
    by_speed,
    coulomb,
    dahl,
    load_dependent,
    logarithmic,
    maxwell_slip,
    note_depth,
    note_load,
    one_way,
    smoothed,
    stribeck,
    swelling,
    tight,
    uneven,
    worked_in,
)
from sim.effects.waves import phase


def _term(name: str, what: str) -> Parameter:
    return Parameter(name, "1", -1.0, 1.0, 0.0, f"{what} of the level, over `coulomb`")


_COULOMB = Parameter(
    "coulomb",
    "N",
    0.0,
    5000.0,
    0.05,
    "friction force while sliding, on either side",
    required=True,
    amplitude=True,
    floor=("force_noise_N", 0.05),
)
_PRESLIDING = Parameter(
    "presliding",
    "mm",
    1e-5,
    0.2,
    0.001,
    "distance over which friction builds up after a reversal",
    starts=(0.001, 0.01),
)

_STATIC_RATIO = Parameter(
    "static_ratio", "1", 1.0, 3.0, 1.6, "friction near rest over friction while sliding, F_s/F_c", starts=(1.2, 2.0)
)
_STRIBECK_SPEED = Parameter(
    "stribeck_speed", "mm/s", 1e-2, 10.0, 2.0, "speed at which the excess at rest has fallen to 1/e", starts=(0.5, 5.0)
)
_VISCOUS = Parameter("viscous", "N*s/mm", 0.0, 1000.0, 0.0, "further force per speed")


def _all_one_way(differs: float, values: Mapping[str, float]) -> tuple[float, ...]:
    """What `one_way` reads where all of it is felt on the way in (1) or on the way out (-1)."""
    return (values["coulomb"], differs, values["presliding"])


def _tared(name: str, differs: float, came: str, felt: str) -> Form:
    return Form(
        name=name,
        what=f"zeroed while it was stuck after a way {came}, so that all of it is felt on the way {felt}",
        parameters=(_COULOMB, _PRESLIDING),
        sought=False,
        blocks={"probe": one_way},
        pack=partial(_all_one_way, differs),
        state=(0.0, 0.0, 0.0),
    )


EFFECT = Effect(
    id="friction",
    what="Friction at the probe acts against its motion and is felt by the load cell.",
    says="friction of {coulomb:force} acts against the motion, either way",
    check="align and grease the guide; see whether cable or seal drags; move slowly in free air and back",
    reference="Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30, 1994, 1083-1138",
    forms=(
        Form(
            name="coulomb",
            what="constant against the direction of motion",
            parameters=(_COULOMB, _PRESLIDING),
            blocks={"probe": coulomb},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="stribeck",
            what="more to break away than to slide, and a part that grows with speed",
            parameters=(
                _COULOMB,
                _STATIC_RATIO,
                _STRIBECK_SPEED,
                _VISCOUS,
                _PRESLIDING,
            ),
            blocks={"probe": stribeck},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="presliding",
            what="gradual build-up after each reversal (Dahl)",
            parameters=(
                _COULOMB,
                Parameter(
                    "presliding",
                    "mm",
                    1e-6,
                    5.0,
                    0.02,
                    "distance over which friction builds up after a reversal",
                    starts=(0.005, 0.03, 0.2),
                ),
            ),
            blocks={"probe": dahl},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="maxwell_slip",
            what="gradual build-up that remembers inner loops",
            parameters=(
                _COULOMB,
                Parameter(
                    "presliding",
                    "mm",
                    1e-5,
                    5.0,
                    0.02,
                    "distance over which the middle element builds up",
                    starts=(0.01, 0.06, 0.3),
                ),
                Parameter("spread", "1", 1.0, 6.0, 2.0, "ratio of the elements' distances", fixed=True),
            ),
            blocks={"probe": maxwell_slip},
            state=(0.0,) * 8,
        ),
        Form(
            name="load_dependent",
            what="grows with the depth in the pad",
            parameters=(
                _COULOMB,
                Parameter("load", "1/mm", 0.0, 20.0, 0.5, "relative growth per mm of depth", starts=(0.3, 2.0)),
                _PRESLIDING,
            ),
            blocks={"depth": note_depth, "probe": load_dependent},
            state=(0.0, 0.0, 0.0, 0.0),
        ),
        Form(
            name="pressed",
            what="grows with the force of the pad",
            parameters=(
                _COULOMB,
                Parameter("load", "1/N", 0.0, 1000.0, 0.5, "relative growth per N", starts=(0.1, 1.0)),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"load": note_load, "probe": load_dependent},
            state=(0.0, 0.0, 0.0, 0.0),
        ),
        Form(
            name="worked_in",
            what="more at first, until the grease is worked in",
            parameters=(
                _COULOMB,
                Parameter("stiffness", "1", 0.0, 5.0, 0.5, "what fresh grease adds, over `coulomb`", starts=(0.5,)),
                Parameter("way", "mm", 0.1, 1e3, 10.0, "distance in which it is worked in", starts=(3.0, 15.0)),
                Parameter("rest", "s", 0.1, 1e4, 30.0, "time in which it comes back", starts=(10.0, 100.0)),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": worked_in},
            state=(0.0, 0.0, 0.0, 0.0),
        ),
        Form(
            name="uneven",
            what="another at each place",
            parameters=(
                _COULOMB,
                _term("sine_1", "one wave over the reach"),
                _term("cosine_1", "the same, from its crest,"),
                _term("sine_2", "two waves over the reach"),
                _term("cosine_2", "the same, from their crest,"),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth over which `coulomb` is the mean", fixed=True),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": uneven},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="tight",
            what="more, or less, at one place of the way",
            parameters=(
                _COULOMB,
                Parameter("more", "1", -0.95, 10.0, 0.5, "what the place adds, over `coulomb`", starts=(0.5,)),
                Parameter("place", "mm", 0.0, 50.0, 1.0, "where that is", bend=True),
                Parameter("width", "mm", 0.02, 10.0, 0.3, "how far from it 1/e of that is left", starts=(0.2, 0.6)),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": tight},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="swelling",
            what="more and less again and again along the way, as balls come in and go",
            parameters=(
                _COULOMB,
                Parameter("swell", "1", 0.0, 1.0, 0.2, "how far it swells, of itself", starts=(0.2,)),
                Parameter(
                    "turn", "mm", 0.1, 50.0, 1.0, "distance after which it is the same", starts=(0.45, 0.65, 0.95, 1.8)
                ),
                phase("angle", "phase of the swell at position 0"),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": swelling},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="logarithmic",
            what="grows with the logarithm of the speed, as of polymers",
            parameters=(
                _COULOMB,
                Parameter("growth", "1", 0.0, 0.1, 0.05, "relative growth for each e-fold of speed", starts=(0.05,)),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": logarithmic},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="one_way",
            what="more the one way than the other",
            parameters=(
                _COULOMB,
                Parameter(
                    "differs",
                    "1",
                    -0.6,
                    0.6,
                    0.2,
                    "what there is more of it on the way in, over the mean of both",
                    default=0.0,
                    starts=(-0.2, 0.2),
                ),
                _PRESLIDING,
            ),
            sought=False,
            blocks={"probe": one_way},
            state=(0.0, 0.0, 0.0),
        ),
        _tared("tared_out", 1.0, "out", "in"),
        _tared("tared_in", -1.0, "in", "out"),
        Form(
            name="by_speed",
            what="by the speed alone, nothing at rest",
            parameters=(
                _COULOMB,
                _STATIC_RATIO,
                _STRIBECK_SPEED,
                _VISCOUS,
                Parameter("speed", "mm/s", 1e-2, 5.0, 0.1, "speed by which it is there", starts=(0.1, 1.0)),
            ),
            blocks={"probe": by_speed},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="smoothed",
            what="less and less as it comes to rest",
            parameters=(
                _COULOMB,
                Parameter("speed", "mm/s", 1e-2, 20.0, 0.5, "speed by which it is there", starts=(0.2, 1.0, 4.0)),
            ),
            sought=False,
            blocks={"probe": smoothed},
            state=(0.0, 0.0, 0.0),
        ),
    ),
)
