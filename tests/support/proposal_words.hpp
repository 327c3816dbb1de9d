// What a proposal of a model says, as text.
#pragma once

#include <string>

#include "diagnosis/proposal/proposal.hpp"

namespace graybox::testing {

// A base of fixtures.
struct ProposalWords {
  static std::string value_of(const ModelProposal& proposal, const std::string& subject) {
    for (const ProposedGuess& guess : proposal.guesses) {
      if (guess.subject == subject) return guess.value + "; " + guess.reason;
    }
    return "";
  }
  static std::string questions_of(const ModelProposal& proposal) {
    std::string text;
    for (const OpenQuestion& each : proposal.questions) text += each.text + each.option + "\n";
    return text;
  }
  static std::string notes_of(const ModelProposal& proposal) {
    std::string text;
    for (const std::string& note : proposal.notes) text += note + "\n";
    return text;
  }
  static std::string all_of(const ModelProposal& proposal) {
    std::string text;
    for (const OpenQuestion& each : proposal.questions) {
      text += "open: " + each.text + " (" + each.option + ")\n";
    }
    for (const std::string& note : proposal.notes) text += "note: " + note + "\n";
    for (const ProposedGuess& each : proposal.guesses) {
      text += each.subject + ": " + each.value + "; " + each.reason + "\n";
    }
    return text;
  }
  static bool says(const ModelProposal& proposal, const std::string& part) {
    return all_of(proposal).find(part) != std::string::npos;
  }
};

}  // namespace graybox::testing
