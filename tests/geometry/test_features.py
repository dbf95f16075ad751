"""Feature labels: as the paper prints them, read back, and the contact in which two features meet."""

from __future__ import annotations

import pytest
from cases import EXAMPLE_1, EXAMPLE_2

from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.elements import Element

PRINTED = (*EXAMPLE_1.labels, *EXAMPLE_2.labels, "V1E2(P1V4; P2V9,V10)", "E1E2(P1V4,V3; P2V9,V10)", "V1V2(P1V10; P2V2)")


@pytest.mark.parametrize("label", PRINTED)
def test_labels_are_read_back_and_printed_alike(label):
    feature = Feature.from_label(label)
    assert feature.label == str(feature) == label
    assert feature.kind == label[:4]
    assert Feature.from_label(f"  {label.replace('; ', ';')} ") == feature


def test_label_says_kind_and_vertices_of_both_bodies():
    feature = Feature(Element("E", (4, 3)), Element("F", (9, 10, 12)))
    assert feature.label == "E1F2(P1V4,V3; P2V9,V10,V12)"
    assert feature.kind == "E1F2"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "V1F2",
        "V1F2(P1V6)",
        "V2F1(P1V6; P2V2,V3,V5)",
        "X1F2(P1V6; P2V2)",
        "V1F2(P1V6; P2V2,V3,V5) and",
        "V1F2(P1V; P2V2)",
        "V1F2(P1V6,; P2V2,V3)",
        "V1E2(P1V6; P2V,3)",
    ],
)
def test_what_is_no_label_is_refused(text):
    with pytest.raises(InputError, match="not a feature label"):
        Feature.from_label(text)


@pytest.mark.parametrize(
    "text", ["V1F2(P1V6,V7; P2V2,V3,V5)", "V1E2(P1V6; P2V2)", "F1V2(P1V1,V2; P2V3)", "V1V2(P1V0; P2V1)"]
)
def test_a_label_whose_kinds_and_vertex_counts_disagree_is_refused(text):
    with pytest.raises(InputError, match="not a feature label"):
        Feature.from_label(text)


MEETINGS = [
    ("V1F2(P1V6; P2V2,V3,V5)", "E1E2(P1V3,V6; P2V2,V5)", "V1E2(P1V6; P2V2,V5)"),
    ("E1E2(P1V3,V6; P2V2,V5)", "F1V2(P1V1,V3,V4,V6; P2V2)", "E1V2(P1V3,V6; P2V2)"),
    ("F1V2(P1V1,V3,V4,V6; P2V2)", "E1E2(P1V1,V4; P2V1,V2)", "E1V2(P1V1,V4; P2V2)"),
    ("F1V2(P1V1,V3,V4,V6; P2V2)", "F1V2(P1V1,V2,V4,V5; P2V2)", "E1V2(P1V1,V4; P2V2)"),
    ("V1F2(P1V4; P2V3,V4,V9,V10)", "E1E2(P1V3,V4; P2V9,V10)", "V1E2(P1V4; P2V9,V10)"),
    ("E1E2(P1V3,V4; P2V9,V10)", "E1E2(P1V4,V5; P2V9,V10)", "V1E2(P1V4; P2V9,V10)"),
    ("E1E2(P1V3,V4; P2V9,V10)", "E1E2(P1V4,V5; P2V10,V11)", "V1V2(P1V4; P2V10)"),
    ("V1F2(P1V4; P2V1,V2,V3)", "V1F2(P1V4; P2V3,V4,V5)", "V1V2(P1V4; P2V3)"),
]


@pytest.mark.parametrize(("first", "second", "expected"), MEETINGS)
def test_two_features_meet_in_their_common_elements(first, second, expected):
    one, two = Feature.from_label(first), Feature.from_label(second)
    assert one.merged(two) == two.merged(one) == Feature.from_label(expected)


def test_features_that_share_no_vertex_do_not_meet_in_one_contact():
    one, two = (Feature.from_label(label) for label in EXAMPLE_2.labels[:2])
    assert one.merged(two) is None
    assert two.merged(one) is None


def test_features_are_values_whatever_the_order_of_their_vertices():
    assert Feature.from_label("E1E2(P1V4,V3; P2V9,V10)") == Feature.from_label("E1E2(P1V3,V4; P2V10,V9)")
    assert len({Feature.from_label(label) for label in (*PRINTED, *PRINTED)}) == len(PRINTED) - 1
    assert Feature.from_label("V1E2(P1V4; P2V9,V10)") != Feature.from_label("V1E2(P1V4; P2V9,V11)")
