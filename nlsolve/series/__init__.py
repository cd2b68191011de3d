"""y(a) = y₀ + a y₁ + a² y₂ + …: truncated power series over arrays, pushed one order at a time.

A `Series` remembers its coefficients and the rule for the next one. Arithmetic on series builds new series whose
coefficient j is computed when first asked for, from the coefficients 0 … j of its operands, with O(j) array
operations; p orders of a whole formula therefore cost O(p²). Write a formula once, for arrays, and run it on

    an array            its values,
    `Series.seed(x)`    its derivative: coefficient 1 of f(x + a) is f′(x),
    a pushed `Series`   its Taylor coefficients along a path x(a).

Recurrences: Griewank & Walther, Evaluating Derivatives (2008), table 13.2. What is not analytic (absolute value,
comparison, choice by condition) has no Taylor coefficients and raises NoSeries. What is analytic, but not at the values
it is run at, as √x at x = 0, has its value there, and raises NoSeriesHere for the first coefficient that there is not.

It may import nothing.
"""

from nlsolve.series.arithmetic import as_column
from nlsolve.series.coefficients import Indices
from nlsolve.series.formulas import Series
from nlsolve.series.refusals import Array, Mask, NoSeries, NoSeriesHere

__all__ = ["Array", "Indices", "Mask", "NoSeries", "NoSeriesHere", "Series", "as_column"]
