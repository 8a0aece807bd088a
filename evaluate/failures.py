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
    reasons = [error.partition(": ")[2] for summary in summaries for error in summary["failed_episodes"]]
    if not reasons:
        return ""
    total = len(reasons) + sum(summary["episodes"] for summary in summaries)
    counts = Counter(reasons).most_common()
    listed = [f"{reason} ({count})" for reason, count in counts[:MAX_REASONS]]
    more = [f"{len(counts) - MAX_REASONS} more reasons"] if len(counts) > MAX_REASONS else []
    return f"{len(reasons)} of {total} episode{'s' * (total != 1)} failed: {'; '.join(listed + more)}"
