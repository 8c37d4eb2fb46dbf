#include "mcap/check.h"

#include <algorithm>
#include <array>

#include "mcap/checker.h"
#include "mcap/crc32.h"
#include "sensing/core/printable.h"

namespace taclink::mcap {

Result<CheckReport> Check(const ByteSource& source, const Limits& limits) {
  return Checker(source, limits).Run();
}

void Checker::Add(Severity severity, uint64_t offset, std::string what) {
  constexpr size_t kMostFindings = 1000;
  ++(severity == Severity::kError ? report_.errors : report_.warnings);
  if (report_.findings.size() < kMostFindings) {
    report_.findings.push_back({.severity = severity, .offset = offset, .what = std::move(what)});
  }
}

void Checker::CheckText(uint64_t offset, const std::string& text, const char* what) {
  if (!IsUtf8(text)) Doubt(offset, std::string(what) + " is not valid UTF-8");
}

Result<CheckReport> Checker::Run() {
  found_.statistics.emplace();
  if (CheckStart() && Walk()) CheckSummary();
  return std::move(report_);
}

bool Checker::CheckStart() {
  std::array<std::byte, kMagic.size()> magic{};
  if (source_.size() < magic.size() || !source_.Read(0, magic) || magic != kMagic) {
    Wrong(0, "the log does not begin with the magic bytes of MCAP, version 0");
    return false;
  }
  data_crc_ = Crc32(magic);
  offset_ = magic.size();
  const auto header = ReadRecordAs<Header>(source_, Opcode::kHeader, offset_, limits_, record_);
  if (!header) {
    Wrong(offset_, "no header: " + header.error().message);
    return false;
  }
  CheckText(offset_, header->profile, "the profile");
  CheckText(offset_, header->library, "the library's name");
  return true;
}

bool Checker::Walk() {
  bool first = true;
  while (true) {
    if (source_.size() - offset_ < kRecordHeaderBytes) {
      Wrong(offset_, "the log ends without a footer: it was not closed, or is cut off");
      return false;
    }
    const auto record = ReadRecord(source_, offset_, limits_, record_);
    if (!record) {
      Wrong(offset_, record.error().message);
      return false;
    }
    const uint64_t length = kRecordHeaderBytes + record->content.size();
    if (record->opcode == Opcode::kFooter) {
      const auto footer = Decoded<Footer>(offset_, record->content);
      if (footer) CheckEnd(*footer);
      return footer.has_value();
    }
    if (record->opcode == Opcode::kHeader && !first) Wrong(offset_, "a second Header");
    first = false;
    Visit(*record, length);
    offset_ += length;
  }
}

void Checker::Visit(const RawRecord& record, uint64_t length) {
  if (newest_chunk_ && record.opcode != Opcode::kMessageIndex) EndNewestChunk();
  if (!in_summary_ && record.opcode == Opcode::kDataEnd) return EndData(record.content);
  if (!in_summary_) {
    const auto opcode = LittleEndian(static_cast<uint8_t>(record.opcode));
    data_crc_ = Crc32(opcode, data_crc_);
    data_crc_ = Crc32(LittleEndian(static_cast<uint64_t>(record.content.size())), data_crc_);
    data_crc_ = Crc32(record.content, data_crc_);
  }
  if (!IsKnown(record.opcode)) return VisitUnknown(record.opcode);
  return in_summary_ ? VisitSummary(record, length) : VisitData(record, length);
}

void Checker::VisitUnknown(Opcode opcode) {
  constexpr auto kFirstOfApplications = static_cast<Opcode>(0x80);
  if (opcode == Opcode{}) {
    Wrong(offset_, "a record of type 0, which is none");
  } else if (opcode < kFirstOfApplications) {
    Doubt(offset_, NameOf(opcode) + ", which version 0 reserves");
  }
}

void Checker::EndData(Bytes content) {
  in_summary_ = true;
  summary_start_ = offset_ + kRecordHeaderBytes + content.size();
  const auto end = Decoded<DataEnd>(offset_, content);
  if (end && end->data_section_crc != 0 && end->data_section_crc != data_crc_) {
    Wrong(offset_, "the CRC of the data section is wrong: something before is damaged");
  }
}

void Checker::CheckFooterOffset(uint64_t told, uint64_t found, const char* what) {
  if (told == found) return;
  // Of what is not there the specification says "should be 0".
  Add(found == 0 ? Severity::kWarning : Severity::kError, offset_,
      std::string("the footer places the ") + what + " at " + std::to_string(told) + ", not at " +
          std::to_string(found));
}

void Checker::CheckEnd(const Footer& footer) {
  if (newest_chunk_) EndNewestChunk();
  if (!in_summary_) Wrong(offset_, "the data section does not end with DataEnd");
  const uint64_t end = offset_ + kRecordHeaderBytes + kFooterBytes;
  std::array<std::byte, kMagic.size()> magic{};
  if (source_.size() - offset_ < kRecordHeaderBytes + kFooterBytes + magic.size() ||
      !source_.Read(end, magic) || magic != kMagic) {
    Wrong(end, "the log does not end with the magic bytes");
  } else if (source_.size() > end + magic.size()) {
    Wrong(end + magic.size(), std::to_string(source_.size() - end - magic.size()) + " bytes after the end");
  }
  if (record_.size() != kFooterBytes) Wrong(offset_, "a footer of a wrong length");
  if (!in_summary_) return;

  const uint64_t offsets = summary_offset_start_.value_or(offset_);
  const uint64_t start = offsets > summary_start_ ? summary_start_ : 0;
  CheckFooterOffset(footer.summary_start, start, "summary");
  CheckFooterOffset(footer.summary_offset_start, summary_offset_start_.value_or(0), "summary offsets");
  const uint64_t size = offset_ + kRecordHeaderBytes + 16 - summary_start_;
  if (footer.summary_crc == 0 || size > limits_.record_bytes) return;
  record_.resize(static_cast<size_t>(size));
  if (source_.Read(summary_start_, record_).ok() && Crc32(record_) != footer.summary_crc) {
    Wrong(summary_start_, "the CRC of the summary is wrong");
  }
}

}  // namespace taclink::mcap
