"""Options of the test suite."""


def pytest_addoption(parser):
    parser.addoption(
        "--no-skips", action="store_true", help="fail if any test is skipped (used in CI)"
    )


def pytest_sessionfinish(session, exitstatus):
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter and session.config.getoption("no_skips") and reporter.stats.get("skipped"):
        reporter.write_line("a test was skipped, and --no-skips forbids that", red=True)
        session.exitstatus = 1
