"""Numbers as the report shows them: `95.7 %`, a true minus sign, and never a negative zero."""

MINUS = "\N{MINUS SIGN}"


def fixed(value: float, digits: int = 3) -> str:
    """`value` with `digits` decimals: `0.120`, and with a true minus sign where it is negative."""
    text = f"{value:.{digits}f}"
    is_zero = not text.strip("-0.")
    return text.lstrip("-") if is_zero else text.replace("-", MINUS)


def signed(value: float, digits: int = 3) -> str:
    """`value` with its sign: `+0.120`; zero has none."""
    text = fixed(value, digits)
    return text if text.startswith(MINUS) or not text.strip("0.") else f"+{text}"


def millimetres(value: float | None, digits: int = 3) -> str:
    """`0.120 mm`, or `-` without a value."""
    return "-" if value is None else f"{fixed(value, digits)} mm"


def percent(share: float | None, digits: int = 1) -> str:
    """A share in [0, 1] as `95.7 %`, or `-` without a value. `100.0 %` is all, and `0.0 %` nothing: what is
    nearly so is `> 99.9 %`, `< 0.1 %`.
    """
    if share is None:
        return "-"
    text, step = fixed(100 * share, digits), 10.0**-digits
    if share < 1 and text == fixed(100, digits):
        return f"> {fixed(100 - step, digits)} %"
    return f"< {fixed(step, digits)} %" if share > 0 and text == fixed(0, digits) else f"{text} %"
