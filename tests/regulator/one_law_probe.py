"""Prints what every target makes of one schedule, each as a hash: run with a package whose source
was changed. Heads and test vectors of the files are left out."""

import hashlib
import json
import shutil
from io import BytesIO
from zipfile import ZipFile

import numpy as np
from exports import CASES, exported

from hydroctl.export.c import sources
from hydroctl.export.contents import contents_of
from hydroctl.export.fmu import regulator_fmu
from hydroctl.export.structured_text import source
from hydroctl.regulator import law
from hydroctl.regulator.formulas import law_formulas
from hydroctl.regulator.printing.javascript import javascript_of
from hydroctl.regulator.vectors import law_of, vectors_of

CASE = "position pid+lead-lag+notch"


def python_answers(regulator):
    """x over a few samples of the law in Python."""
    memory, answers = law.AT_REST, []
    for k in range(8):
        memory = law.sample(
            0.2 + 0.004 * k**2, 0.02, (9e6, 8e6, 0.0, 0.21 + 0.003 * (k % 3)), memory, regulator
        )
        answers.append(float(memory.x))
    return answers


def c_code(text):
    """Without head and self test, which hold hashes and test vectors."""
    return text[text.index("enum {") : text.index("#ifdef PRESS_SELF_TEST")]


def st_code(text):
    """Without the head, which holds hashes."""
    return text[text.index("FUNCTION") :]


def targets():
    """By target, what stands for the law in it."""
    schedule = exported(**CASES[CASE])
    contents = contents_of(schedule, force=True)
    regulator = law_of(schedule.regulator)
    with np.errstate(all="ignore"):
        made = {
            "python": python_answers(regulator),
            "c": c_code(sources(contents, "press", "double")[1].decode()),
            "structured text": st_code(source(contents, "press", "double").decode()),
            "javascript": javascript_of(regulator),
            "formulas": law_formulas(schedule.regulator),
            "vectors": [v.x for v in vectors_of(schedule.regulator)],
            "linear": abs(schedule.regulators.frequency_response([20.0, 300.0])).tolist(),
        }
    if shutil.which("cc"):
        whole = contents_of(exported(**CASES[CASE], delay_samples=1), force=True)
        with ZipFile(BytesIO(regulator_fmu(whole, "press"))) as archive:
            made["fmu"] = c_code(archive.read("sources/press.c").decode())
    return made


print(
    json.dumps(
        {
            name: hashlib.sha256(json.dumps(value).encode()).hexdigest()
            for name, value in targets().items()
        }
    )
)
