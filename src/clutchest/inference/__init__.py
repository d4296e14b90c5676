"""What data say of unknown numbers: linearisation, noise, most probable values, score tests."""
