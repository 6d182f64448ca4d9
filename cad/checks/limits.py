"""Findings from a value and its limit: the constructors that all checks share."""

from scanwright.cad.layout.loads import RATED_AT_MM, rated_moment_nm
from scanwright.cad.layout.names import SERVO
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner


def at_most(
    code: str,
    value: float,
    limit: float,
    unit: str,
    subject: str,
    what: str,
    error: float | None = None,
    hint: str = "",
) -> Finding:
    """Return an error if the value exceeds the limit or is NaN, a warning if value + error does.

    Args:
        code: of the finding.
        value: measured.
        limit: largest value that passes.
        unit: of value, limit and error.
        subject: part or product.
        what: name of the value, for the message.
        error: uncertainty of the value; None if unknown.
        hint: what to do if it does not pass.
    """
    within, surely = value <= limit, value + (error or 0.0) <= limit
    severity: Severity = "ok" if surely else "warning" if within else "error"
    message = f"{subject}: {what}: {with_error(value, error)} {unit} (at most {figures(limit)})"
    return Finding(code, severity, subject, message, tidy(value), tidy(limit), unit, "" if surely else hint)


def at_least(code: str, value: float, limit: float, unit: str, subject: str, what: str) -> Finding:
    """Return an error if the value is below the limit; arguments as for `at_most`."""
    message = f"{subject}: {what}: {figures(value)} {unit} (at least {figures(limit)})"
    return Finding(code, "error" if value < limit else "ok", subject, message, tidy(value), tidy(limit), unit)


def note(code: str, value: float, unit: str, subject: str, what: str, error: float | None = None) -> Finding:
    """Return a value that has no limit; arguments as for `at_most`."""
    message = f"{subject}: {what}: {with_error(value, error)} {unit}"
    return Finding(code, "note", subject, message, tidy(value), None, unit)


def rated(
    code: str, value: float, rating: float | None, unit: str, subject: str, what: str, by: str = "", hint: str = ""
) -> Finding:
    """Return `at_most` of a maker's rating, whose origin is `by`, or a note if the maker states none."""
    if rating is None:
        return note(code, value, unit, subject, f"{what}, unrated by its maker")
    return at_most(code, value, rating, unit, subject, f"{what}{by}", hint=hint)


def horn_check(scanner: Scanner, moment_nm: float, what: str, hint: str) -> Finding:
    """Return the tilt moment on the servo's horn against its rating; `what` and `hint` as for `at_most`."""
    by = f", rated {scanner.servo.radial_load_n:g} N at {RATED_AT_MM:g} mm" if scanner.servo.radial_load_n else ""
    return rated("tilt_moment", moment_nm, rated_moment_nm(scanner), "N m", SERVO, what, by, hint)


def with_error(value: float, error: float | None) -> str:
    """Return a value with its uncertainty, if that is known."""
    return figures(value) if error is None else f"{figures(value)} ± {error:.1g}"


def figures(value: float) -> str:
    """Return three significant figures, without an exponent for large numbers."""
    short = f"{value:.3g}"
    return f"{float(short):,.0f}" if "e+" in short else short


def spot(point: Array) -> str:
    """Return a point [mm], shape (3,), for a message, to a tenth."""
    x, y, z = (f"{round(float(c), 1) + 0.0:g}" for c in point)
    return f"at ({x}, {y}, {z}) in the rotation frame"


def tidy(value: float) -> float:
    """Round to four significant digits: further ones depend on the kernel's version."""
    return float(f"{value:.4g}") + 0.0
