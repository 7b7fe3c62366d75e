"""What set-ups of a machine share belongs to the numbers that each of them asked for."""

from wm_drake.model.drawn_machine import SetUpCache
from wm_drake.parameters import with_value

MOVED = (-0.22, -0.06, 0.37)


class Frames(dict):
    """Overrides of frames that let another thread run while they are compared."""

    between = staticmethod(lambda: None)

    def __ne__(self, other):
        """Let the other thread run once, then compare."""
        run, self.between = self.between, lambda: None
        run()
        return super().__ne__(other)


def test_set_up_of_another_thread_in_between_does_not_change_the_poses(machine, reference):
    cache, frame = SetUpCache(), ("housing", "spring_left_housing")
    moved = with_value(reference, "frames.spring_left_housing.position", MOVED)
    ours = reference.model_copy(update={"frames": Frames(reference.frames)})
    drawn = cache.frame_poses(machine.drawn.plant, ours)(*frame)[0].copy()
    ours.frames.between = lambda: cache.frame_poses(machine.drawn.plant, moved)
    assert (cache.frame_poses(machine.drawn.plant, ours)(*frame)[0] == drawn).all()
    assert (cache.frame_poses(machine.drawn.plant, moved)(*frame)[0] != drawn).any()


def test_same_overrides_share_their_poses_and_others_do_not(machine, reference):
    cache = SetUpCache()
    poses = cache.frame_poses(machine.drawn.plant, reference)
    stiffer = with_value(reference, "gasket.stiffness_x", 4000.0)
    moved = with_value(reference, "frames.spring_left_housing.position", MOVED)
    assert cache.frame_poses(machine.drawn.plant, stiffer) is poses
    assert cache.frame_poses(machine.drawn.plant, moved) is not poses
