"""Settings: defaults read back, every mistake is one line with file, key and what is allowed."""

from pathlib import Path

import pytest

from robot import config, settings_file
from robot.errors import UserError


def check(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return config.load(path)


def test_the_commented_defaults_read_back_as_the_defaults(tmp_path):
    assert check(tmp_path, config.commented_defaults()) == config.Config()


def test_every_setting_is_shown_with_words_and_what_is_allowed():
    lines = [line for line in config.commented_defaults().splitlines() if " = " in line]
    assert len(lines) > 50
    assert all("  # " in line and ";" in line.split("  # ")[1] for line in lines)


def test_an_empty_file_is_all_defaults(tmp_path):
    assert check(tmp_path, "") == config.Config()


def test_a_setting_is_taken(tmp_path):
    assert check(tmp_path, "[base]\nmax_speed_m_s = 0.1\n").base.max_speed_m_s == 0.1


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[base]\nmax_speed_m_s = 9.0", ["base.max_speed_m_s = 9.0", "from 0 to 2"]),
        ("[base]\nmax_sped_m_s = 1.0", ["base.max_sped_m_s", "did you mean 'max_speed_m_s'"]),
        ("[base]\ndriver = 'hovercraft'", ['base.driver = "hovercraft"', "nxt-usb"]),
        ("[base]\nmax_speed_m_s = 'fast'", ['base.max_speed_m_s = "fast"', "number from 0 to 2"]),
        ("[vision]\ndisparities = 17", ["vision.disparities = 17", "multiple of 16"]),
        ("[vision.track]\nrate_hz = 0.0\ncost_s = 0.1", ["vision.track.rate_hz = 0.0", "from 0.1 to 100"]),
        ("[wings]\nspan_m = 1.0", ["wings: unknown key", "base"]),
        ("speed = ", ["not valid TOML", "end of document"]),
    ],
)
def test_a_mistake_is_one_line_with_file_key_and_what_is_allowed(tmp_path, text, parts):
    with pytest.raises(UserError) as caught:
        check(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "robot.toml"))
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_a_missing_file_names_the_command_that_makes_one(tmp_path):
    with pytest.raises(UserError, match="robot config show"):
        config.load(tmp_path / "none.toml")


def test_settings_cannot_be_changed_after_reading():
    with pytest.raises(AttributeError):
        config.Config().base.max_speed_m_s = 1.0


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="cannot be read"):
        settings_file.read(path, config.Config)


def test_the_sample_config_is_valid_and_shows_every_key():
    path = Path(__file__).parents[1] / "deploy" / "robot.toml"
    sample = config.load(path)
    assert sample.base.driver == "nxt-usb"
    keys = {line.split(" = ")[0] for line in config.commented_defaults().splitlines() if " = " in line}
    text = path.read_text(encoding="utf-8")
    assert all(f"{key} = " in text for key in keys)
