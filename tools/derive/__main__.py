import sys

try:
    from .generate import main
except ModuleNotFoundError as missing:
    if missing.name not in ("numpy", "scipy", "sympy"):
        raise
    print(f"{missing.name} is not installed; pip install -r tools/requirements.txt", file=sys.stderr)
    raise SystemExit(2) from None

raise SystemExit(main())
