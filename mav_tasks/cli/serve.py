"""``mav-tasks serve``: run the task server. Its options for settings are declared with these."""

import signal
from functools import cached_property
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from mav_tasks.cli.lazy import beginning_with, completing
from mav_tasks.cli.options import DEFAULT_LISTEN
from mav_tasks.config.setting_keys.key import Key, Option
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.setting_keys.shapes import Choice, Texts
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.config.words import Flag


class ServeCommand(TyperCommand):
    """The command with the options that the settings declare; ``ctx.obj`` has the given ones."""

    @cached_property
    def _options(self) -> list[tuple[Key, Option, TyperOption]]:
        return [
            (k, option, _typer_option(k, option)) for k in KEYS.values() for option in k.options
        ]

    def get_params(self, ctx: Any) -> list[Any]:
        return [*(made for _, _, made in self._options), *super().get_params(ctx)]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments. Of two options for one key the one declared last counts."""
        rest = super().parse_args(ctx, self._with_values(args))
        given = {}
        for key, option, made in self._options:
            value = ctx.params.pop(made.name, None)
            if value is not None and value is not False and value != ():
                plain = value if option.sets is None else option.sets
                plain = list(plain) if isinstance(plain, tuple) else plain
                given[key.name] = Flag(option.name, key.name, plain)
        ctx.obj = list(given.values())
        return rest

    def _with_values(self, args: list[str]) -> list[str]:
        """Return the arguments with a value for each option that may be given without one."""
        bare = {option.name: option.bare for _, option, _ in self._options if option.bare}
        bare["--web"] = DEFAULT_LISTEN
        filled = []
        for argument, following in zip(args, [*args[1:], "-"], strict=False):
            filled.append(argument)
            if argument in bare and following.startswith("-"):
                filled.append(bare[argument])
        return filled


def _typer_option(key: Key, option: Option) -> TyperOption:
    is_switch = option.sets is not None
    is_list = isinstance(key.shape, Texts) and not is_switch
    words = key.shape.words if isinstance(key.shape, Choice) else ()

    def complete(_ctx: Any, _before: Any, incomplete: str) -> list[Any]:
        return [*beginning_with(incomplete, words)]

    return TyperOption(
        param_decls=[each for each in (option.name, option.short) if each],
        is_flag=is_switch or None,
        default=False if is_switch else None,
        multiple=is_list,
        metavar=option.metavar or None,
        autocompletion=complete,
        help=option.help or _help(key, is_switch=is_switch, is_list=is_list),
    )


def _help(key: Key, *, is_switch: bool, is_list: bool) -> str:
    words = f"{key.meaning[0].upper()}{key.meaning[1:]}"
    if is_switch:
        return f"{words}."
    plain = key.plain_of(ServerSettings())
    default = ", ".join(plain) if isinstance(plain, list) else literal(plain).strip('"')
    words += f" ({key.shape.valid}){'; repeatable' if is_list else ''}."
    return f"{words} Default: {default}." if default else words


def serve(
    ctx: typer.Context,
    config: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help='Configuration file; default: config.toml in your configuration folder; "": none.',
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            autocompletion=completing("mav_tasks.cli.config:assignments"),
            help="Set any key of the configuration; repeatable.",
        ),
    ] = None,
    web: Annotated[
        str,
        typer.Option(
            metavar="[HOST:PORT]",
            help=f"Also run 'mav-tasks web' as long as the server runs, at {DEFAULT_LISTEN} unless "
            "you name another address.",
        ),
    ] = "",
) -> None:
    """Run the task server.

    By default clients connect to UDP 14560, and the server connects to the rover on UDP 14580.
    """
    # Ignore SIGHUP until the configuration is read; by default it would end the process.
    signal.signal(signal.SIGHUP, lambda _number, _frame: None)
    from mav_tasks.cli.serving import serve_with  # noqa: PLC0415  # takes long: after that

    raise typer.Exit(serve_with(ctx.obj, set_=set_ or (), config=config, web=web))
