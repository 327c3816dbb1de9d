#pragma once
#include "problems/high/roof.hpp"
#include "problems/low/missing.hpp"
