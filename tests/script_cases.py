"""Cases of a script that checks files: what is in one, and what lines it must say of it."""
import subprocess
import sys
import tempfile
from pathlib import Path


def run_cases(script, name, cases):
    """`cases`: (what, text of the file `name`, parts of the lines expected) or with a name of its own as the
    fourth. The exit code."""
    path = Path(sys.argv[1]) / "scripts" / script
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for what, text, expected, *own_name in cases:
            file = Path(folder) / (own_name[0] if own_name else name)
            file.write_text(text)
            result = subprocess.run([sys.executable, path, file], capture_output=True, text=True)
            lines = result.stdout.splitlines() if result.returncode else []
            if len(lines) != len(expected) or not all(e in line for e, line in zip(expected, lines)):
                print(f"{what}: expected {expected}, got {result.returncode} {result.stdout}{result.stderr}")
                faults += 1
    print(f"{len(cases)} cases, {faults} faults")
    return 1 if faults else 0
