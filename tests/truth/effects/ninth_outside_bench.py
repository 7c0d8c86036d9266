"""Effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: J. C. Candy and O. J. Benjamin, The
structure of quantization noise from sigma-delta modulation, IEEE Trans. Commun. 29 (1981) 1316; N. Ahmed, T. Natarajan
and K. R. Rao, Discrete cosine transform, IEEE Trans. Comput. C-23 (1974) 90; A. Haar, Zur Theorie der orthogonalen
Funktionensysteme, Math. Ann. 69 (1910) 331, and D. L. Donoho and I. M. Johnstone, Ideal spatial adaptation by wavelet
shrinkage, Biometrika 81 (1994) 425; N. S. Jayant, Adaptive delta modulation with a one-bit memory, Bell Syst. Tech. J.
49 (1970) 321; J. A. Greefkes and K. Riemens, Code modulation with digitally controlled companding for speech
transmission, Philips Tech. Rev. 31 (1970) 335; B. W. Wah, X. Su and D. Lin, A survey of error-concealment schemes for
real-time audio and video transmissions over the Internet, Proc. IEEE Multimedia Softw. Eng. (2000) 17; V. V. Krylov,
Vibrational impact of high-speed trains, J. Acoust. Soc. Am. 100 (1996) 3121; M. Heckl, G. Hauck and R. Wettschureck,
Structure-borne sound and vibration from rail traffic, J. Sound Vib. 193 (1996) 175.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.fft import dct, idct

from .fourth_outside_bench import _wandering
from .outside_bench import _AMPLIFIER, _child
from .registry import Build, effect, spread
from .sensor import _disturb


@effect("idle_tones", "rising", "folded")
def idle_tones(build: Build, shape: str, size: float) -> dict[str, float]:
    """A converter of one bit sings: a tone whose frequency goes with the force, and whose phase adds up over time.

    `rising`: in proportion, to 3 to 9 Hz at the greatest force. `folded`: up and down again, once to twice over the
    forces there are, up to as much. In air it stands still, at whatever phase it has come to.
    """
    rng, most = build.rng, build.force_N
    amplitude, frequency = 0.018 * size * most * spread(rng, 0.8, 1.25), spread(rng, 3.0, 9.0)
    folds = 2 * float(rng.uniform(1.0, 2.0))

    def stage(t, force):
        part = force / most
        if shape == "folded":
            part = 2 * np.abs(part * folds / 2 - np.round(part * folds / 2))
        turns = np.concatenate([[0.0], np.cumsum((part[1:] + part[:-1]) / 2 * np.diff(t))])
        return force + amplitude * np.sin(2 * np.pi * frequency * turns)

    build.sensor(_AMPLIFIER, stage)
    return {"amplitude": amplitude, "frequency": frequency, "folds": folds}


def haar_kept(blocks: np.ndarray, least: float) -> np.ndarray:
    """Blocks (k, 2^m) without those of their Haar parts that are smaller than `least` on either side of their middle.

    The mean of each block stays.
    """
    means, parts = blocks, []
    while means.shape[1] > 1:
        half = (means[:, ::2] - means[:, 1::2]) / 2
        means = (means[:, ::2] + means[:, 1::2]) / 2
        parts.append(half)
    for half in reversed(parts):
        # Weighed as an orthonormal part is: what is short must be the higher.
        weight = np.sqrt(half.shape[1])
        kept = np.where(np.abs(half) >= least * weight, half, 0.0)
        means = np.stack([means + kept, means - kept], axis=2).reshape(len(means), -1)
    return means


@effect("lossy_codec", "cosines", "haar")
def lossy_codec(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force is kept in blocks of 0.2 to 0.8 s, each as parts of which the small ones are lost, before and after.

    `cosines`: of a discrete cosine transform, each in whole numbers of a step. `haar`: steps that halve the block, its
    halves, and so on; those below a level are dropped, the mean of the block is kept.
    """
    rng, most = build.rng, build.force_N
    loses, lasts_s = 0.025 * size * most * spread(rng, 0.8, 1.25), spread(rng, 0.2, 0.7)

    def stage(t, force):
        h = float(t[1] - t[0])
        length = round(lasts_s / h)
        if shape == "haar":
            length = 2 ** round(np.log2(length))
        count = -(-len(force) // length)
        blocks = np.concatenate([force, np.full(count * length - len(force), force[-1])]).reshape(count, length)
        if loses == 0:
            return force
        if shape == "haar":
            return haar_kept(blocks, 0.7 * loses).ravel()[: len(force)]
        step = loses * np.sqrt(length)
        kept = np.round(dct(blocks, norm="ortho", axis=1) / step) * step
        return idct(kept, norm="ortho", axis=1).ravel()[: len(force)]

    build.sensor(_AMPLIFIER, stage)
    return {"loses": loses, "lasts": lasts_s}


@njit(cache=True)
def _coded(force, every, least, most, grows, syllabic):
    """Up by a step, down by a step, or neither within half of the least, every so many steps of time.

    The step grows by a factor as the code comes again, and else falls by its square; `syllabic`: towards `most` where
    the last three are alike, by a fifth of the way, and back by a twelfth.
    """
    out, y, step, last, before = force.copy(), force[0], least, 0.0, 0.0
    for k in range(force.shape[0]):
        if k % every == 0:
            left = force[k] - y
            code = 0.0 if abs(left) <= 0.5 * least else np.sign(left)
            if syllabic:
                alike = code != 0 and code == last and code == before
                step += (most - step) / 5 if alike else (least - step) / 12
            else:
                step = min(max(step * grows if code != 0 and code == last else step / grows**2, least), most)
            y += code * step
            before, last = last, code
        out[k] = y
    return out


@effect("delta_code", "one_bit_memory", "syllabic")
def delta_code(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force is sent as ups and downs, by steps that adapt: late and beyond as it goes quickly, unquiet at rest.

    300 to 500 codes a second, fewer the larger the effect. `one_bit_memory`: the step grows by 1.5 to 1.8 as a code
    comes again, and falls by the square of that. `syllabic`: towards 0.15 of the greatest force after three alike, and
    slowly back.
    """
    rng, most = build.rng, build.force_N
    least, every_s = 0.015 * size * most * spread(rng, 0.8, 1.25), size / spread(rng, 300.0, 500.0)
    grows, syllabic = float(rng.uniform(1.5, 1.8)), shape == "syllabic"

    def stage(t, force):
        every = max(round(every_s / float(t[1] - t[0])), 1)
        return force if least == 0 else _coded(force, every, least, max(0.15 * most, least), grows, syllabic)

    build.sensor(_AMPLIFIER, stage)
    return {"least": least, "every": every_s}


@effect("concealment", "fades", "goes_on")
def concealment(build: Build, shape: str, size: float) -> dict[str, float]:
    """What is lost on the way is made up: every 0.8 to 1.6 s, at random, for 0.1 s or so, nobody says when.

    `fades`: the last value, which fades within 0.6 to 1.2 s. `goes_on`: on the line through the last value and that as
    long ago as the loss lasts; then it is back at once.
    """
    rng, child = build.rng, _child(build.rng)
    lasts_s, fades_s = 0.1 * size * spread(rng, 0.8, 1.25), spread(rng, 0.6, 1.2)
    count = int(np.ceil((build.plant.duration_s + 10) / 0.8)) + 2
    begins, lengths = np.cumsum(child.uniform(0.8, 1.6, count)), lasts_s * child.uniform(0.6, 1.4, count)

    def stage(t, force):
        last = np.searchsorted(begins, t, side="right") - 1
        begun, length = begins[np.maximum(last, 0)], lengths[np.maximum(last, 0)]
        since = t - begun
        held = np.interp(begun, t, force)
        if shape == "fades":
            made_up = held * np.exp(-since / fades_s)
        else:
            slope = (held - np.interp(begun - length, t, force)) / np.maximum(length, 1e-9)
            made_up = held + slope * since
        return np.where((last >= 0) & (since < length), made_up, force)

    build.sensor(_AMPLIFIER, stage)
    return {"lasts": lasts_s}


@effect("railway", "axles", "rumble")
def railway(build: Build, shape: str, size: float) -> dict[str, float]:
    """Trains pass the house, every 5 to 10 s for 2.5 to 5 s, and the cell feels the ground give way and shake.

    `axles`: the ground gives way under each pair of bogies, 0.3 to 0.5 s apart, to one side, five to nine times, each
    wagon as heavy as it is. `rumble`: a noise of 8 to 25 ms, which swells and dies away as a Gaussian.
    """
    rng, child, duration = build.rng, _child(build.rng), build.plant.duration_s
    amplitude = 0.04 * size * build.force_N * spread(rng, 0.8, 1.25)
    apart_s, time_s = spread(rng, 0.3, 0.5), spread(rng, 0.008, 0.025)
    count = int(np.ceil((duration + 20) / 5)) + 2
    middles = np.cumsum(child.uniform(5.0, 10.0, count)) - float(rng.uniform(2.0, 5.0))
    lasts, wagons = child.uniform(2.5, 5.0, count), child.integers(5, 10, count)
    heavy, along = child.uniform(0.5, 1.5, (count, 9)), _wandering(child, duration, time_s, 0.001)

    def added(t):
        out = np.zeros_like(t)
        for middle, length, number, weights in zip(middles, lasts, wagons, heavy, strict=True):
            if shape == "rumble":
                # All but a fiftieth of it within the time that it lasts.
                out += np.exp(-0.5 * ((t - middle) / (length / 4)) ** 2) * along(t)
                continue
            for k in range(number):
                at = middle + (k - (number - 1) / 2) * apart_s
                out += weights[k] * np.exp(-0.5 * ((t - at) / (apart_s / 6)) ** 2)
        return amplitude * out

    _disturb(build, added)
    return {"amplitude": amplitude, "apart": apart_s, "time": time_s}
