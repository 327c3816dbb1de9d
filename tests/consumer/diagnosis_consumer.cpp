// A campaign that is not there is refused with one line.
#include <cstdio>
#include <cstring>

#include "graybox/diagnosis/recordings/campaign.hpp"
#include "graybox/problems/base/error.hpp"

int main() {
  try {
    (void)graybox::read_campaign("nowhere");
  } catch (const graybox::InputError& error) {
    std::puts(error.what());
    return std::strstr(error.what(), "nowhere") != nullptr ? 0 : 1;
  }
  return 1;
}
