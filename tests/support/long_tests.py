"""Tests that take longer than `.ci/run` has time for."""

import os

import pytest

long_test = pytest.mark.skipif("LONG_TESTS" not in os.environ, reason="LONG_TESTS=1 runs it")
