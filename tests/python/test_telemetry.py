"""What `sim` publishes is heard by Debian's lcm-logger, and its log holds the same as ours."""

import shutil
import subprocess

import numpy as np
import pytest
from equipoise_tools.log import read_log


@pytest.mark.skipif(shutil.which("lcm-logger") is None, reason="lcm-logger (liblcm-bin) is not installed")
def test_lcm_logger_hears_a_run(root, tmp_path):
    shell = (
        'lcm-logger --quiet --lcm-url="udpm://239.255.76.67:7667?ttl=0" "$3" & logger=$!; sleep 0.5; '
        '"$0" sim --config "$1" --duration-s 2 --realtime --log "$2"; status=$?; '
        "sleep 0.2; kill -INT $logger; wait $logger; exit $status"
    )
    command = [root / "tools/lib/multicast", "sh", "-c", shell, root / "build/host/equipoise"]
    command += [root / "config/mbbr.toml", tmp_path / "ours.lcm", tmp_path / "theirs.lcm"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    if ended.returncode == 77:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr
    ours = read_log(tmp_path / "ours.lcm")
    theirs = read_log(tmp_path / "theirs.lcm")
    assert theirs["EQUIPOISE_RUN"][0].config_sha256 == ours["EQUIPOISE_RUN"][0].config_sha256
    heard = theirs["EQUIPOISE_STATE"]
    assert len(heard) > 200  # UDP and a busy machine may lose some of 400
    logged = ours["EQUIPOISE_STATE"][np.searchsorted(ours["EQUIPOISE_STATE"]["tick"], heard["tick"])]
    np.testing.assert_array_equal(heard, logged)
