#pragma once
#include "problems/low/foundation.hpp"
