"""The schema as records: what each element may hold, for telling what is wrong with one.

Of XSD 1.0 it reads what our schema uses: named types, ``all``, ``choice`` and ``sequence`` of
elements, numbers and words with attributes, groups of attributes. ``build_rules`` raises
``ValueError`` on anything else, so that no rule of the schema is ignored.
"""

import re
from dataclasses import dataclass, field

from lxml import etree

from msahl.deck.faults import Element, collapsed

_XS = "{http://www.w3.org/2001/XMLSchema}"
_UNBOUNDED = "unbounded"
_FACETS = {"annotation", "enumeration", "pattern", "minInclusive", "maxInclusive", "minLength"}
_INTEGER = re.compile(r"[+\-]?[0-9]+")


@dataclass(frozen=True, slots=True)
class Word:
    """Text without children: one of ``allowed`` if any are, a match of ``pattern`` if there is one,
    a number from ``low`` to ``high`` if they are given, and not empty if ``filled``."""

    allowed: tuple[str, ...] = ()
    pattern: re.Pattern[str] | None = None
    low: float | None = None
    high: float | None = None
    filled: bool = False

    def accepts(self, given: str) -> bool:
        """Whether the text is valid; white space is collapsed first."""
        given = collapsed(given)
        if self.allowed:
            return given in self.allowed
        if self.pattern is not None and not self.pattern.fullmatch(given):
            return False
        if self.low is not None and float(given) < self.low:
            return False
        if self.high is not None and float(given) > self.high:
            return False
        return bool(given) or not self.filled


@dataclass(slots=True)
class Rule:
    """What an element holds: text (``word``), or children in a group of one ``model``.

    ``model`` is ``all``, ``choice``, ``sequence`` or, for an element that holds nothing, empty.
    ``once`` says that the group is not repeated, ``needed`` that it may not be empty; ``required``
    are the children that may not be missing. ``optional`` text may be empty, for it has a default.
    """

    word: Word | None = None
    optional: bool = False
    model: str = ""
    once: bool = True
    needed: bool = False
    children: dict[str, "Rule"] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    attributes: dict[str, Word] = field(default_factory=dict)


def build_rules(schema: bytes, root: str) -> Rule:
    """The rule of the element ``root`` of a schema, with those of all elements inside it."""
    return _Schema(schema).element_rule(root)


class _Schema:
    """The named definitions of a schema, read when they are asked for."""

    def __init__(self, schema: bytes) -> None:
        parser = etree.XMLParser(remove_comments=True)
        self._named = {(str(e.tag), e.get("name")): e for e in etree.fromstring(schema, parser)}
        self._rules: dict[str, Rule] = {}
        self._words: dict[str, Word] = {
            "xs:token": Word(),
            "xs:double": Word(),
            "xs:integer": Word(pattern=_INTEGER),
        }

    def element_rule(self, name: str) -> Rule:
        """The rule of the schema's own element ``name``."""
        return self._rule_of(self._named[_XS + "element", name])

    def _rule_of(self, element: Element) -> Rule:
        """The rule of a declared element: its type's."""
        named, inline = element.get("type"), element.find(_XS + "complexType")
        if inline is not None:
            return self._complex(inline)
        if not named:
            raise ValueError(f"element {element.get('name')} has no type")
        optional = element.get("default") is not None
        if (_XS + "complexType", named) not in self._named:
            return Rule(word=self._word(named), optional=optional)
        if named not in self._rules:
            self._rules[named] = self._complex(self._named[_XS + "complexType", named])
        return self._rules[named]

    def _complex(self, element: Element) -> Rule:
        """The rule of a complex type."""
        rule = Rule()
        for part in element.iterchildren(etree.Element):
            match str(part.tag).removeprefix(_XS):
                case "annotation":
                    pass
                case "all" | "choice" | "sequence":
                    self._group(part, rule)
                case "attribute" | "attributeGroup":
                    self._attribute(part, rule)
                case "simpleContent":
                    (extension,) = part
                    rule.word = self._word(extension.get("base", ""))
                    for attribute in extension:
                        self._attribute(attribute, rule)
                case other:
                    raise ValueError(f"complexType: {other} is not understood")
        return rule

    def _group(self, group: Element, rule: Rule) -> None:
        """Children of a group become those of the ``rule``."""
        rule.model = str(group.tag).removeprefix(_XS)
        rule.once = group.get("maxOccurs") != _UNBOUNDED
        rule.needed = group.get("minOccurs") != "0"
        members = [member for member in group if member.tag != _XS + "annotation"]
        if any(member.tag != _XS + "element" for member in members):
            raise ValueError(f"{rule.model}: holds something other than elements")
        rule.children = {str(member.get("name")): self._rule_of(member) for member in members}
        needs = rule.model == "all"
        rule.required = tuple(
            str(m.get("name")) for m in members if needs and m.get("minOccurs") != "0"
        )

    def _attribute(self, element: Element, rule: Rule) -> None:
        """An attribute, or those of a group, become those of the ``rule``."""
        if element.tag == _XS + "attributeGroup":
            for attribute in self._named[str(element.tag), element.get("ref")]:
                self._attribute(attribute, rule)
            return
        if element.tag != _XS + "attribute":
            raise ValueError(f"attribute: {element.tag} is not understood")
        inline, named = element.find(_XS + "simpleType"), element.get("type", "")
        word = self._word(named) if inline is None else self._simple(inline)
        rule.attributes[str(element.get("name"))] = word

    def _word(self, name: str) -> Word:
        """The rule of a simple type by name."""
        if name not in self._words:
            self._words[name] = self._simple(self._named[_XS + "simpleType", name])
        return self._words[name]

    def _simple(self, element: Element) -> Word:
        """The rule of a simple type: its base's, restricted."""
        restriction = element.find(_XS + "restriction")
        if restriction is None:
            raise ValueError("simpleType: only a restriction is understood")
        base = self._word(restriction.get("base", ""))
        facets = [(str(f.tag).removeprefix(_XS), str(f.get("value"))) for f in restriction]
        told = dict(facets)
        if not told.keys() <= _FACETS or told.get("minLength", "1") != "1":
            raise ValueError(f"restriction: {', '.join(told)} is not understood")
        return Word(
            allowed=tuple(value for facet, value in facets if facet == "enumeration"),
            pattern=re.compile(told["pattern"]) if "pattern" in told else base.pattern,
            low=float(told["minInclusive"]) if "minInclusive" in told else base.low,
            high=float(told["maxInclusive"]) if "maxInclusive" in told else base.high,
            filled=base.filled or "minLength" in told,
        )
