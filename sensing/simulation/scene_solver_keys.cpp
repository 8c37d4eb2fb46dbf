// What a SceneSolver keeps of a balance, and how it comes back from that.
#include <algorithm>
#include <limits>
#include <utility>

#include "sensing/simulation/scene_solver.h"

namespace taclink {
Eigen::VectorXf SceneSolver::PlaceOf(const SkinBalance& balance) const {
  Eigen::VectorXf place(6 * static_cast<Eigen::Index>(rest_.mids_mm.size()));
  for (size_t i = 0; i < rest_.mids_mm.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    place.segment<3>(at) = (balance.state.mids_mm[i] - rest_.mids_mm[i]).cast<float>();
    place.segment<3>(at + 3) = (balance.state.directors[i] - rest_.directors[i]).cast<float>();
  }
  return place;
}

SkinKey SceneSolver::MakeKey(const ScenePart& part, const Around& around, double time_s,
                             const SkinBalance& balance) {
  SkinKey key{time_s, PlaceOf(balance), {}, {}};
  key.rate.setZero(key.place.size());
  std::vector<KeyContact::Numbers> now, rates(around.now.discs.size(), KeyContact::Numbers::Zero());
  WriteContacts(around.now, balance, now);
  if (!part.still) WriteRates(around, balance, key.rate, rates);
  for (size_t i = 0; i < now.size(); ++i) {
    const bool on = around.now.discs[i].on;
    greatest_n_[i] = std::max(greatest_n_[i], now[i].head<3>().norm());
    if (part.pressing[i] && !on) {  // about to touch, or just did
      const SkinSpot spot = loads_.plans()[i].SpotAt(time_s);
      const double depth = loads_.TouchingDepth(i, spot, balance.state);
      now[i].tail<4>() << model_.PointAtDepth(spot.angle_rad, spot.z_mm, depth).cast<float>(),
          static_cast<float>(depth);
    }
    if (!on) rates[i].setZero();
    key.contacts.push_back(
        {now[i], rates[i], on, balance.limited[i] || loads_.StopsShort(i, around.now, time_s)});
  }
  return key;
}

void SceneSolver::WriteRates(const Around& around, const SkinBalance& balance, Eigen::VectorXf& rate,
                             std::vector<KeyContact::Numbers>& contact_rates) {
  const auto h = around.either_side_s;
  const SkinRates rates = skin_.RatesAt(around.before, around.after, 2 * h, balance);
  for (size_t i = 0; i < rates.mids_mm.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    rate.segment<3>(at) = rates.mids_mm[i].cast<float>();
    rate.segment<3>(at + 3) = rates.directors[i].cast<float>();
  }
  const auto moved = [&](double by_s) {
    SkinBalance other = balance;
    for (size_t i = 0; i < rates.mids_mm.size(); ++i) other.state.mids_mm[i] += by_s * rates.mids_mm[i];
    for (size_t i = 0; i < rates.depth_mm.size(); ++i) other.depth_mm[i] += by_s * rates.depth_mm[i];
    return other;
  };
  std::vector<KeyContact::Numbers> earlier, later;
  WriteContacts(around.before, moved(-h), earlier);
  WriteContacts(around.after, moved(h), later);
  for (size_t i = 0; i < later.size(); ++i)
    contact_rates[i] = (later[i] - earlier[i]) / static_cast<float>(2 * h);
}

void SceneSolver::WriteContacts(const SkinLoad& load, const SkinBalance& balance,
                                std::vector<KeyContact::Numbers>& numbers) {
  const std::vector<RigidContact::Summary> contacts = skin_.Contacts(load, balance);
  numbers.assign(contacts.size(), KeyContact::Numbers::Zero());
  for (size_t i = 0; i < contacts.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on) continue;
    const bool searched = disc.force_n && !balance.limited[i];
    const double depth = searched ? balance.depth_mm[i] : disc.depth_mm;
    const Vec3 center = contacts[i].points > 0 ? contacts[i].center_mm
                                               : model_.PointAtDepth(disc.angle_rad, disc.z_mm, depth);
    numbers[i] << contacts[i].force_n.cast<float>(), center.cast<float>(), static_cast<float>(depth);
  }
}

SkinBalance SceneSolver::FromPlace(const Eigen::VectorXf& place) const {
  std::vector<Vec3> mids_mm = rest_.mids_mm, directors = rest_.directors;
  for (size_t i = 0; i < mids_mm.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    mids_mm[i] += place.segment<3>(at).cast<double>();
    directors[i] += place.segment<3>(at + 3).cast<double>();
  }
  return skin_.NearTo(mids_mm, directors);
}

SkinBalance SceneSolver::BalanceOf(const SkinKey& key, double after_s) const {
  SkinBalance balance = FromPlace(key.place + static_cast<float>(after_s) * key.rate);
  for (size_t i = 0; i < key.contacts.size(); ++i) {
    const KeyContact& contact = key.contacts[i];
    balance.depth_mm[i] = contact.on ? contact.value[6] + after_s * contact.rate[6] : kOffMm;
    balance.limited[i] = contact.limited;
  }
  return balance;
}

SkinBalance SceneSolver::BalanceBetween(const SkinKey& from, const SkinKey& to, double time_s) const {
  SkinBalance balance = FromPlace(PlaceAt(from, to, time_s));
  for (size_t i = 0; i < from.contacts.size(); ++i) {
    const KeyContact &a = from.contacts[i], &b = to.contacts[i];
    balance.depth_mm[i] = kOffMm;
    if (a.on && b.on) balance.depth_mm[i] = ContactAt(from, to, i, time_s)[6];
    balance.limited[i] = a.limited && b.limited;
  }
  return balance;
}

}  // namespace taclink
