"""Groups of commands in the help, and the options `-q` and `-v` of every command."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, ClassVar, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import OptionInfo

from scanwright.cli.console import Verbosity, name_elsewhere, name_options, set_verbosity, styled

F = TypeVar("F", bound=Callable[..., Any])

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results only.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print every step and full warnings.")]


class Commands(typer.Typer):
    """A group of commands with a title; each has the options `-q` and `-v`, and calls `first` before it runs."""

    def __init__(self, title: str = "", first: Callable[[], None] = lambda: None) -> None:
        super().__init__(rich_markup_mode=None, pretty_exceptions_enable=False)
        self.title, self.first = title, first

    def command(self, name: str | None = None, *, example: str = "", no: str = "", **options: Any) -> Callable[[F], F]:
        """As typer's own; the help ends with an `example` and the exit codes, of which 1 means `no` if given."""
        codes = ["0 done", *([f"1 {no}"] if no else []), "2 wrong input"]
        codes += ["3 device fault", "130 interrupted"] if self.title == "Devices" else ["130 interrupted"]
        epilog = f"Example: scanwright {example}\n\nExit codes: {'; '.join(codes)}"
        register = super().command(name, cls=_Command, epilog=epilog, rich_help_panel=self.title, **options)

        def registered(function: F) -> F:
            if self.title == "Clouds":  # warnings of recordings name these options
                name_elsewhere(name or function.__name__, _options_of(inspect.signature(function, eval_str=True)))
            register(_with_verbosity(function, self.first))
            return function

        return registered


class _Command(TyperCommand):
    """A command whose usage line has no braces around arguments."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the usage, with `RECORDING` in place of `{RECORDING}`."""
        return [re.sub(r"[{}]", "", piece) for piece in super().collect_usage_pieces(ctx)]


class GroupedHelp(TyperGroup):
    """The help with a section for each group of commands, without abbreviated descriptions."""

    titles: ClassVar[tuple[str, ...]] = ("Design", "Parts", "Devices", "Clouds", "Pages")

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the sections in the order of the work."""
        commands: list[tuple[str, Any]] = [(name, self.commands[name]) for name in self.list_commands(ctx)]
        width = max(len(name) for name, _ in commands)
        for title in self.titles:
            rows = [(name.ljust(width), first_sentence(c)) for name, c in commands if c.rich_help_panel == title]
            if rows:
                with formatter.section(styled(title, "heading")):
                    formatter.write_dl(rows)


def first_sentence(command: Any) -> str:
    """Return the first sentence of the docstring of a command."""
    paragraph = str(command.help or "").split("\n\n", maxsplit=1)[0].replace("\n", " ")
    return re.split(r"\.(?: (?=[A-Z])|$)", paragraph, maxsplit=1)[0]


def _with_verbosity(function: Callable[..., Any], first: Callable[[], None]) -> Callable[..., Any]:
    """Return the function with options for its verbosity, which are not passed to it; it runs after `first`."""
    signature = inspect.signature(function, eval_str=True)
    options = _options_of(signature)

    @wraps(function)
    def run(*args: Any, quiet: bool = False, verbose: bool = False, **kwargs: Any) -> Any:
        name_options(options)
        if quiet or verbose:
            set_verbosity(Verbosity.QUIET if quiet else Verbosity.VERBOSE)
        first()
        return function(*args, **kwargs)

    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
        for name, kind in (("quiet", Quiet), ("verbose", Verbose))
    ]
    vars(run)["__signature__"] = signature.replace(parameters=[*signature.parameters.values(), *added])
    return run


def _options_of(signature: inspect.Signature) -> dict[str, str]:
    """Return the options of a command by parameter."""
    return {name: option for name, each in signature.parameters.items() if (option := _option(name, each))}


def _option(name: str, parameter: inspect.Parameter) -> str:
    """Return the option of a parameter, such as `--min-range-m`; empty for an argument."""
    for info in getattr(parameter.annotation, "__metadata__", ()):
        if isinstance(info, OptionInfo):
            written = (info.default, *(info.param_decls or ()))  # typer stores the first one as the default
            named = (text for text in written if isinstance(text, str) and text.startswith("--"))
            return next(named, f"--{name.replace('_', '-')}")
    return ""
