#!/usr/bin/env python3
"""scripts/check_sizes finds what is too large, and nothing that is not.

    tests/check_sizes_test.py SOURCE
"""
import sys

from script_cases import run_cases

BODY = "  work();\n"
MEMBERS = """struct Box {
  explicit Box(int size) : a_{size}, b_(size) {}
  int f() const { return a_; }
  std::function<void(int, int)> g(int x = 0);
  static constexpr int kLimit = 3;
  enum class Kind { kOne, kTwo };
  struct Inside { int x, y, z; };
  using Table = std::map<int, int>;
  friend bool operator==(const Box& a, const Box& b);
 private:
  int a_{0}, b_ = 1;
  std::map<int, std::vector<int>> c_;
  std::array<double, 3> d_ = {1.0, 2.0, 3.0};
  std::function<void(int, int)> e_;
%s};
"""


def function(lines, head="void f(int x) {\n"):
    return head + BODY * (lines - 2) + "}\n"


CASES = [
    ("a function of 60 lines", function(60), []),
    ("one of 61", function(61), ["function f has 61 lines"]),
    ("one of a class", "void Big::run(const std::vector<int>& v) const {\n" + BODY * 60 + "}\n", ["Big::run has 62 lines"]),
    ("a test", function(61, "TEST(Big, IsLong) {\n"), ["function Big.IsLong has 61 lines"]),
    ("braces in strings and comments", 'const char* t = "{"; // {\n' + function(61), ["function f has 61"]),
    ("a lambda counts with its function", "int f() {\n  const auto g = [](int x) {\n" + BODY * 58 + "  };\n}\n",
     ["function f has 62 lines"]),
    ("a table is no function", "const int kTable[] = {\n" + "  1,\n" * 80 + "};\n", []),
    ("a class of 300 lines", "class C {\n" + "  void f();\n" * 298 + "};\n", []),
    ("one of 301", "class C final : public B {\n" + "  void f();\n" * 299 + "};\n", ["class C has 301 lines"]),
    ("20 members", MEMBERS % "".join(f"  int m{i};\n" for i in range(15)), []),
    ("21 members", MEMBERS % "".join(f"  int m{i};\n" for i in range(16)), ["class Box has 21 members"]),
    ("a file of 1001 lines", "// a line\n" * 1001, ["1001 lines, 1000 at most"]),
]


if __name__ == "__main__":
    sys.exit(run_cases("check_sizes", "case.cpp", CASES))
