"""Number and reasons of episodes that ended in an exception."""

from collections import Counter
from collections.abc import Sequence

from footfall.evaluate.figures import Summary

MAX_REASONS = 3  # reasons in a line


def failures(summaries: Sequence[Summary]) -> str:
    """'2 of 24 episodes failed: ValueError: no (2)', the most frequent reasons first; empty if none did.

    Args:
        summaries: summaries of scenarios, as `footfall.evaluate.summary.summarise` makes them.
    """
    failed = [error.partition(": ")[2] for summary in summaries for error in summary["failed_episodes"]]
    if not failed:
        return ""
    total = len(failed) + sum(summary["episodes"] for summary in summaries)
    counted = Counter(failed).most_common()
    named = [f"{reason} ({count})" for reason, count in counted[:MAX_REASONS]]
    more = [f"{len(counted) - MAX_REASONS} more reasons"] if len(counted) > MAX_REASONS else []
    return f"{len(failed)} of {total} episode{'s' * (total != 1)} failed: {'; '.join(named + more)}"
