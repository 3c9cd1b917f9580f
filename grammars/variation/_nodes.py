"""The nodes of a variation's syntax tree that are told apart, named like their rules."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

from grammars.text.source import SyntaxNode, TypedNode


class ImportNode(TypedNode):
    """``import "kitchen.fpm"``."""

    file: str


class LetNode(TypedNode):
    """``let wide = uniform(0.8 .. 1.4)``."""

    name: str
    value: ValueNode


class RequireNode(TypedNode):
    """``require hall.area >= 12 m^2``."""

    left: SumNode
    comparison: Literal["<=", "<", ">=", ">", "==", "!="]
    right: SumNode


class BlockNode(TypedNode):
    """``hall: { shape.width: wide }``; attributes have a ``path`` and a ``value``."""

    target: SyntaxNode
    attributes: list[SyntaxNode]


class SingleNode(TypedNode):
    """``ceiling: uniform([2.4, 2.7])``."""

    target: SyntaxNode
    value: ValueNode


class UniformNode(TypedNode):
    """``uniform(1.0 .. 2.0)``, or ``uniform([1.0, 2.0])`` without ``low`` and ``high``."""

    low: SyntaxNode
    high: SyntaxNode
    values: list[SyntaxNode]


class DiscreteNode(TypedNode):
    """``discrete([(0.8, 5.0), (0.2, 2.0)])``; pairs have a ``weight`` and a ``value``."""

    pairs: list[SyntaxNode]


class NormalNode(TypedNode):
    """``normal(mean=1.0, std=0.3)``; options have a ``key`` and a ``value``."""

    options: list[SyntaxNode]


class SumNode(TypedNode):
    """Products that are added; every one of ``rest`` has an ``operator`` and an ``operand``."""

    first: SyntaxNode
    rest: list[SyntaxNode]


class MinusNode(TypedNode):
    """``-x``."""

    operand: FactorNode


class GroupNode(TypedNode):
    """``(x + y)``."""

    expression: SumNode


class CallNode(TypedNode):
    """``min(x, y)``."""

    function: str
    arguments: list[SumNode]


class LiteralNode(TypedNode):
    """``0.8 m``."""

    number: str
    unit: str


class ReferenceNode(TypedNode):
    """``hall.pillar.height``."""

    path: SyntaxNode


DistributionNode: TypeAlias = UniformNode | DiscreteNode | NormalNode
ValueNode: TypeAlias = DistributionNode | SumNode
FactorNode: TypeAlias = MinusNode | GroupNode | CallNode | LiteralNode | ReferenceNode
NODES: Final = (
    *(ImportNode, LetNode, RequireNode, BlockNode, SingleNode),
    *(UniformNode, DiscreteNode, NormalNode),
    *(SumNode, MinusNode, GroupNode, CallNode, LiteralNode, ReferenceNode),
)
