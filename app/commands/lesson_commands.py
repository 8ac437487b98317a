"""The command of `walk` around lessons: a teacher tries what was written before anybody guesses."""

from dataclasses import dataclass

import tyro

from walkcore import record
from walkcore.scenario.lesson import Lesson, lesson_files, load_lesson

OTHERWISE = 1
"""Exit code of a lesson whose experiment does not prove the answer that it explains, and no other."""


@dataclass(frozen=True, slots=True)
class LessonsCommand:
    """List the lessons that ship, or try some: simulate their walks, and say which answers these prove.

    Exit code: 0 if each proves the answer that it explains and no other, 1 if one does not, 2 for bad input.
    """

    lessons: tyro.conf.Positional[tuple[str, ...]] = ()
    """Names of some that ship, or files."""

    def __call__(self) -> int:
        """List or try."""
        if not self.lessons:
            for name in lesson_files():
                print(f"{name:28} {load_lesson(name).title}")
            return 0
        lessons = [load_lesson(name) for name in self.lessons]  # all of them, before anything runs
        return max(_tried(lesson) for lesson in lessons)


def _tried(lesson: Lesson) -> int:
    """Simulate a lesson's walks, and print what they say; the exit code."""
    metrics = {name: record(walk).metrics() for name, walk in lesson.walks.items()}
    right = lesson.right(metrics)
    is_so = right == [lesson.answer]
    print(f"{lesson.name}: {lesson.title}")
    for name, choice in lesson.choices.items():
        print(f"  {'right' if name in right else 'wrong'}  {name}: {choice.text}")
        for walk, verdicts in choice.verdicts(metrics).items():
            for v in verdicts:
                print(f"         {walk}: {v.name} = {v.bound}, measured {v.measured}{'' if v.holds else ' (broken)'}")
    if not is_so:
        print(f"  BROKEN: the text explains {lesson.answer}, the walks prove {', '.join(right) or 'none'}")
    return 0 if is_so else OTHERWISE
