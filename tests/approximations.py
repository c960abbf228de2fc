"""What a GPU's approximate instructions may return, on this processor: a right result, a few units off."""

from __future__ import annotations

import re

_RIGHT = {
    "rcp": "%right = fdiv double 1.0, %wide",
    "rsqrt": "%root = call double @llvm.sqrt.f64(double %wide)\n%right = fdiv double 1.0, %root",
    "sqrt": "%right = call double @llvm.sqrt.f64(double %wide)",
}
_FUNCTION = """
define internal float @approximate_{name}(float %x) {{
%size = call float @llvm.fabs.f32(float %x)
%denormal = fcmp olt float %size, 0x3810000000000000
%zero = call float @llvm.copysign.f32(float 0.0, float %x)
%flushed = select i1 %denormal, float %zero, float %x
%wide = fpext float %flushed to double
{right}
%y = fptrunc double %right to float
%size.y = call float @llvm.fabs.f32(float %y)
%large = fcmp oge float %size.y, 0x3810000000000000
%finite = fcmp one float %size.y, 0x7FF0000000000000
%ordinary = and i1 %large, %finite
%bits = bitcast float %y to i32
%moved = add i32 %bits, {units}
%near = bitcast i32 %moved to float
%zero.y = call float @llvm.copysign.f32(float 0.0, float %y)
%other = select i1 %large, float %y, float %zero.y
%nan = fcmp uno float %y, %y
%special = select i1 %nan, float %y, float %other
%made = select i1 %ordinary, float %near, float %special
ret float %made
}}
"""
_DECLARED = {
    "float @llvm.copysign.f32(float, float)": "copysign.f32(",
    "float @llvm.fabs.f32(float)": "fabs.f32(",
    "double @llvm.sqrt.f64(double)": "sqrt.f64(",
}


def on_a_processor(text: str, units: int) -> str:
    """Return LLVM's text with every approximate instruction replaced; denormal arguments and
    results are flushed to 0.

    Args:
        text: for a GPU.
        units: what is added to the last place of each approximation, unless it is 0, infinite or not a number.
    """
    text = re.sub(r"declare .*@llvm\.nvvm\.\w+\.approx.*\n", "", text)
    text = re.sub(r"@llvm\.nvvm\.(\w+)\.approx\.ftz\.f\(", r"@approximate_\1(", text)
    used = [name for name in _RIGHT if f"@approximate_{name}(" in text]
    made = "".join(_FUNCTION.format(name=name, right=_RIGHT[name], units=units) for name in used)
    declared = [f"declare {it}\n" for it, call in _DECLARED.items() if call in made and f"declare {it}" not in text]
    return text + "\n" + "".join(declared) + made
