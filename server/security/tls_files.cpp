#include "server/security/tls_files.h"

#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/objects.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <memory>
#include <utility>
#include <vector>

#include "server/security/secret_file.h"
#include "server/security/tls_policy.h"

namespace taclink::server {
namespace {

template <auto kFree>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

Bio MakeBio(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

// All certificates of a PEM text, in their order.
std::vector<Certificate> Certificates(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  std::vector<Certificate> out;
  while (Certificate next{PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr)})
    out.push_back(std::move(next));
  ERR_clear_error();
  return out;
}

Certificate FirstCertificate(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return certificate;
}

// Never asks a terminal for a password.
int NoPassword(char*, int, int, void*) {
  return -1;
}

Key ReadKey(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return key;
}

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

// Empty: the key is strong enough.
std::string WeaknessOf(const EVP_PKEY* key) {
  const int kind = EVP_PKEY_get_base_id(key), bits = EVP_PKEY_get_bits(key);
  const auto too_short = [bits](const char* name, int least) {
    return bits >= least ? std::string()
                         : "has " + std::string(name) + " key of " + std::to_string(bits) +
                               " bits, and must have at least " + std::to_string(least);
  };
  if (kind == EVP_PKEY_RSA || kind == EVP_PKEY_RSA_PSS) return too_short("an RSA", kLeastRsaBits);
  if (kind == EVP_PKEY_EC) return too_short("an EC", kLeastEcBits);
  if (kind == EVP_PKEY_ED25519 || kind == EVP_PKEY_ED448) return {};
  const char* const name = EVP_PKEY_get0_type_name(key);
  return "has a key of type " + std::string(name != nullptr ? name : "unknown") +
         ", and must have one of RSA, EC or Ed25519";
}

// Empty: it is strong enough. Nobody checks the signature that a root has of itself.
std::string WeaknessOf(X509* certificate, bool is_root) {
  const EVP_PKEY* const key = X509_get0_pubkey(certificate);
  if (key == nullptr) return "has a key that cannot be read";
  if (std::string weakness = WeaknessOf(key); !weakness.empty()) return weakness;
  int digest = NID_undef;
  const bool known = X509_get_signature_info(certificate, &digest, nullptr, nullptr, nullptr) == 1;
  const bool weak = digest == NID_sha1 || digest == NID_md5 || digest == NID_md5_sha1 || digest == NID_md4 ||
                    digest == NID_mdc2 || digest == NID_ripemd160;
  if (is_root || !known || !weak) return {};
  return "is signed with " + std::string(OBJ_nid2sn(digest)) + ", and must be with SHA-256 or stronger";
}

// Those of the server's own file, where the first is never taken for a root, or those that clients' must be
// signed by.
Result<void> CheckStrength(const std::string& what, const std::string& pem, bool is_authorities) {
  const std::vector<Certificate> certificates = Certificates(pem);
  for (size_t i = 0; i < certificates.size(); ++i) {
    X509* const one = certificates[i].get();
    const bool is_own = X509_NAME_cmp(X509_get_subject_name(one), X509_get_issuer_name(one)) == 0;
    const std::string weakness = WeaknessOf(one, is_own && (is_authorities || i > 0));
    if (weakness.empty()) continue;
    const std::string number = certificates.size() == 1 ? "" : " (certificate " + std::to_string(i + 1) + ")";
    return Error{ErrorCode::kInvalidArgument,
                 what + number + " " + weakness +
                     "; make a new one, for example with openssl req -newkey rsa:3072 -sha256"};
  }
  return {};
}

}  // namespace

Result<TlsMaterial> ReadTlsFiles(const SecurityConfig& config) {
  auto certificate = ReadSecurityFile("security.certificate", config.certificate);
  if (!certificate) return certificate.error();
  auto key = ReadSecretFile("security.key", config.key);
  if (!key) return key.error();
  TlsMaterial out{.certificate = std::move(*certificate), .key = std::move(*key), .client_ca = {}};
  const Certificate own = FirstCertificate(out.certificate);
  if (!own)
    return Invalid("security.certificate " + config.certificate + " holds no certificate in PEM form");
  const Key own_key = ReadKey(out.key);
  if (!own_key)
    return Invalid("security.key " + config.key + " holds no private key in PEM form without a password");
  const bool match = X509_check_private_key(own.get(), own_key.get()) == 1;
  ERR_clear_error();
  if (!match)
    return Invalid("security.key " + config.key + " is not the key of the certificate " + config.certificate);
  if (const auto strong = CheckStrength("security.certificate " + config.certificate, out.certificate, false);
      !strong)
    return strong.error();
  if (config.client_ca.empty()) return out;
  auto client_ca = ReadSecurityFile("security.client_ca", config.client_ca);
  if (!client_ca) return client_ca.error();
  if (!FirstCertificate(*client_ca))
    return Invalid("security.client_ca " + config.client_ca + " holds no certificate in PEM form");
  if (const auto strong = CheckStrength("security.client_ca " + config.client_ca, *client_ca, true); !strong)
    return strong.error();
  out.client_ca = std::move(*client_ca);
  return out;
}

std::string TlsWarnings(const SecurityConfig& config, const TlsMaterial& material) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  const Certificate own = FirstCertificate(material.certificate);
  if (own && X509_cmp_current_time(X509_get0_notAfter(own.get())) < 0)
    add("the certificate " + config.certificate + " has expired; clients will refuse it");
  if (own && X509_cmp_current_time(X509_get0_notBefore(own.get())) > 0)
    add("the certificate " + config.certificate + " is not valid yet; check the clock");
  return out;
}

}  // namespace taclink::server
