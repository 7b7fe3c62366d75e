"""Run the command `wm-drake` as `python -m wm_drake`."""

from wm_drake.cli import main

if __name__ == "__main__":
    main()
